"""Parallel curves of parts: grown and shrunk outlines, exactly on lines and arcs.

The points within a distance d of a region are the region, a strip of width d outside every edge, and a wedge of that
radius outside every convex corner. On the concave side of an arc of radius R <= d the strip ends at the arc's centre:
what lies beyond is nearer to something else. The boundaries of all of these, counter-clockwise, add up to one curve per
loop (the common sides cancel), and the grown region is where the winding number is positive.
"""

from __future__ import annotations

from math import isfinite

import numpy as np

from d4cad.arrangement import regions
from d4cad.edges import Complexes, Floats, chords
from d4cad.errors import GeometryError
from d4cad.loop import ROUNDING, Loop
from d4cad.sketch import Sketch

CUSP = 1e-9
"""Radians from a full reversal below which curvatures tell whether a tip is sharp material or a sharp gap."""


def offset(sketch: Sketch, distance: float) -> Sketch:
    """The points within ``distance`` of the sketch; with a negative one, those further than that from its outside.

    ``distance``: in the sketch's unit, > 0 grows (outer loops outwards, holes narrower), < 0 shrinks, 0 gives the
    sketch itself. Arcs stay arcs, convex corners are rounded with that radius (those of gaps where it shrinks), what
    vanishes is gone, and an empty sketch may result. Raises GeometryError for a distance that is not finite.

    >>> square = Sketch.from_loops([Loop.polyline([(0, 0), (4, 0), (4, 4), (0, 4)])], "mm")
    >>> round(offset(square, 1).area - np.pi, 9), offset(square, -1).area, offset(square, -2).faces
    (32.0, 4.0, ())
    """
    if not isfinite(distance):
        raise GeometryError(f"the distance of an offset must be finite, got {distance}")
    if distance == 0 or not sketch.faces:
        return sketch
    touch = ROUNDING * max(loop.extent for loop in sketch.loops)
    if distance > 0:
        raw = [_parallel(loop, distance, touch) for loop in sketch.loops]
    else:  # the outside grows: it winds once more than the reversed loops, and what stays is where that sum is 0
        raw = [_parallel(loop.reversed(), -distance, touch).reversed() for loop in sketch.loops]
    return Sketch.from_loops(regions(raw), sketch.unit)


def _parallel(loop: Loop, d: float, touch: float) -> Loop:
    """The curve to the right of a loop at distance d > 0, with all that is cut off by `regions` later.

    Edge after edge: its parallel curve, or by way of its centre; between them a round corner of radius d where the
    loop turns left, and the way through the vertex where it turns right.
    """
    e = loop.edges
    chord, half = chords(e), 2 * np.arctan(e.b)
    heading = (e.z1 - e.z0) / chord
    start, end = heading * np.exp(-1j * half), heading * np.exp(1j * half)  # tangents
    curvature = 2 * np.sin(half) / chord
    turn = np.angle(np.roll(start, -1) / end)
    straight_back = np.pi - np.abs(turn) < CUSP
    turn = np.where(straight_back, np.where(curvature + np.roll(curvature, -1) < 0, np.pi, -np.pi), turn)
    gone = curvature * (d + touch) <= -1  # concave, of radius d or less
    z: list[complex] = []
    b: list[float] = []
    for k in range(e.b.size):
        z.append(complex(e.z0[k] - 1j * d * start[k]))
        if gone[k]:
            b += [0.0, 0.0]
            z.append(complex(e.z0[k] + 1j * start[k] / curvature[k]))
        else:
            b.append(float(e.b[k]))
        z.append(complex(e.z1[k] - 1j * d * end[k]))
        if turn[k] >= 0:
            b.append(float(np.tan(turn[k] / 4)))
        else:
            b += [0.0, 0.0]
            z.append(complex(e.z1[k]))
    return Loop.from_arrays(*_distinct(np.array(z), np.array(b), touch))


def _distinct(z: Complexes, b: Floats, touch: float) -> tuple[Floats, Floats]:
    """Vertices (n, 2) and bulges (n,) without edges shorter than rounding."""
    keep = np.abs(np.roll(z, -1) - z) > 1e-3 * touch
    return np.stack([z.real, z.imag], axis=1)[keep], b[keep]
