"""Bodies and holes without sides that face each other, such as triangles: their largest inscribed circle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from d4cad.exporters.checks.spans import Spans
from d4cad.loop import Loop
from d4cad.offsets import offset
from d4cad.sketch import Face, Sketch

ACCURACY = 1e-4
"""Share of the limit to which a diameter is found."""


def inscribed(loops: Sequence[Loop], facing: Spans, limit: float) -> Spans:
    """A diameter of the largest circle in each counter-clockwise loop, horizontal, where it is less than ``limit`` and
    than the spans ``facing`` in that loop; the shortest first. Loops inside others do not count.

    The inradius of a region is at least its area through its perimeter; it is the largest distance by which the region
    can shrink and not vanish.
    """
    found: list[tuple[complex, float]] = []
    middles = (facing.p + facing.q) / 2
    points = np.stack([middles.real, middles.imag], axis=1)
    for loop in loops:
        low, high = loop.area / loop.length, limit / 2
        if low <= 0 or low >= high:
            continue
        high = float(facing.length[loop.contains(points)].min(initial=limit)) * (1 - ACCURACY) / 2
        region = Sketch((Face(loop),), "mm")
        if low >= high or offset(region, -high).faces:
            continue
        centre = complex(loop.edges.z0.mean())
        while high - low > ACCURACY * limit / 2:
            middle = (low + high) / 2
            rest = offset(region, -middle)
            if rest.faces:
                low, centre = middle, complex(rest.faces[0].outer.edges.z0.mean())
            else:
                high = middle
        found.append((centre, (low + high) / 2))
    found.sort(key=lambda item: item[1])
    centres, radii = np.array([c for c, _ in found], dtype=np.complex128), np.array([r for _, r in found])
    return Spans(centres - radii, centres + radii, 2.0 * radii)
