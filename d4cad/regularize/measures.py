"""What relations are written in: measures of every edge with their derivatives by the parameters.

Every derivative is by the five numbers of one edge (:mod:`d4cad.regularize.parameters`), so that relations, which
are sums and differences of measures, get theirs as sums and differences of rows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from d4cad.edges import Floats
from d4cad.regularize.parameters import Parameters


@dataclass(frozen=True, slots=True, eq=False)
class Measure:
    """One number for each of k things. value: (k,). rows: (k, n) its derivatives by n parameters, or by whatever linear
    image of them the rows were taken to.
    """

    value: Floats
    rows: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Measures:
    """Measures of E edges.

    x, y: where edge k starts; in a full circle, its centre. heading: angle of the chord. bend: half the sweep, 2
    atan(bulge). bulge: as it is. chord: natural logarithm of its length. radius: natural logarithm; of a line 0.
    cx, cy: centre; of a line 0. px, py: where edge k starts, always. along: (E,) complex unit vectors of the chords.
    """

    x: Measure
    y: Measure
    px: Measure
    py: Measure
    heading: Measure
    bend: Measure
    bulge: Measure
    chord: Measure
    radius: Measure
    cx: Measure
    cy: Measure
    along: np.ndarray[tuple[int, ...], np.dtype[np.complex128]]

    @classmethod
    def of(cls, layout: Parameters, params: Floats) -> Measures:
        """All measures at ``params`` (n,)."""
        count = layout.starts[-1]
        start = params[: 2 * count : 2] + 1j * params[1 : 2 * count : 2]
        d = start[layout.following] - start
        length = np.abs(d)
        arcs, b = layout.arcs, np.zeros(count)
        b[arcs] = params[2 * count :]
        safe = np.where(arcs, b, 1.0)
        zero, one = np.zeros(count), np.ones(count)
        tx, ty = d.real / length**2, d.imag / length**2

        def measure(value: Floats, *slopes: Floats) -> Measure:
            rows = np.zeros((count, layout.size + 1))  # one column more, for the bulge that a line has not
            np.add.at(rows, (np.arange(count)[:, None], layout.columns), np.stack(slopes, axis=1))
            return Measure(value, rows[:, :-1])

        # The centre is mid + i d f with f = (1 - b^2) / (4 b); df/db = -(1 + b^2) / (4 b^2).
        f = np.where(arcs, (1 - safe**2) / (4 * safe), 0.0)
        slope = np.where(arcs, -(1 + safe**2) / (4 * safe**2), 0.0)
        half = np.where(arcs, 0.5, 0.0)
        center = np.where(arcs, start + d / 2 + 1j * d * f, 0.0)
        radius = np.where(arcs, np.log(length * (1 + safe**2) / (4 * np.abs(safe))), 0.0)
        bent = np.where(arcs, 2 * safe / (1 + safe**2) - 1 / safe, 0.0)
        found = cls(
            x=measure(start.real.copy(), one, zero, zero, zero, zero),
            y=measure(start.imag.copy(), zero, one, zero, zero, zero),
            px=measure(start.real, one, zero, zero, zero, zero),
            py=measure(start.imag, zero, one, zero, zero, zero),
            heading=measure(np.angle(d), ty, -tx, -ty, tx, zero),
            bend=measure(2 * np.arctan(b), zero, zero, zero, zero, 2 / (1 + b * b)),
            bulge=measure(b, zero, zero, zero, zero, one),
            chord=measure(np.log(length), -tx, -ty, tx, ty, zero),
            radius=measure(radius, -tx * 2 * half, -ty * 2 * half, tx * 2 * half, ty * 2 * half, bent),
            cx=measure(center.real, half, f, half, -f, -d.imag * slope),
            cy=measure(center.imag, -f, half, f, half, d.real * slope),
            along=d / length,
        )
        rings = [k for loop in np.flatnonzero(layout.circles) for k in (layout.starts[loop], layout.starts[loop] + 1)]
        for point, middle in ((found.x, found.cx), (found.y, found.cy)):
            point.value[rings], point.rows[rings] = middle.value[rings], middle.rows[rings]
        return found

    def taken_to(self, transform: Floats) -> Measures:
        """The measures with every row multiplied by ``transform`` (n, k) from the right."""
        names = ("x", "y", "px", "py", "heading", "bend", "bulge", "chord", "radius", "cx", "cy")
        kept = {name: getattr(self, name) for name in names}
        stacked = np.concatenate([kept[name].rows for name in names]) @ transform
        count = len(self.along)
        changed: dict[str, Any] = {
            name: Measure(kept[name].value, stacked[k * count : (k + 1) * count]) for k, name in enumerate(names)
        }
        return replace(self, **changed)
