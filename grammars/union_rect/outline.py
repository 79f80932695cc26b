"""From rectangles to exact sketches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d4cad.grammars.arc_line.repair import repair as arranged
from d4cad.grammars.union_rect.repair import repair
from d4cad.grammars.union_rect.sides import frames, free_parts
from d4cad.grammars.union_rect.structure import corners, to_pixels
from d4cad.program import Floats

if TYPE_CHECKING:
    from d4cad.sketch import Loop, Sketch

GROWTH = (0.0, 1e-3, 1e-2)
"""By how many grains rectangles are grown, each time a little differently, until their boundary comes out right."""
AGREE = 0.1
"""Grains of length by which a boundary may differ from the sum of the free parts of the sides."""


def union(rects: Floats, grain: float) -> Sketch:
    """The boundary of the union of rectangles (n, 5), in their unit.

    Edges under a tenth of the length ``grain`` are left out, and holes of under two grains squared or about one grain
    wide are filled; corners that touch are pulled apart by a thousandth of it.
    """
    from d4cad.sketch import Sketch

    drawn, _, _ = repair(to_pixels(rects[(rects[:, 2] > 0) & (rects[:, 3] > 0)], 1 / grain), 0.0, 1.0)
    _, places = free_parts(drawn, frames(drawn), -1, -1, True)
    length = float(places[:, 4].sum())
    found: list[tuple[float, list[Loop]]] = []
    for growth in GROWTH:
        grown = drawn.copy()
        grown[:, 2:4] += growth * (1 + np.arange(len(drawn))[:, None] / len(drawn))
        loops = _boundary(corners(grown).reshape(-1, 2))
        found.append((abs(sum(loop.length for loop in loops) - length), loops))
        if found[-1][0] <= AGREE + 16 * growth * len(drawn):
            break
    _, loops = min(found, key=lambda item: item[0])
    kept = [
        loop for loop in loops if loop.area > 0 or -2 * loop.area > loop.length
    ]  # a slit's area is half its length times its width
    return Sketch.from_loops([loop.scaled(grain) for loop in kept], "world")


def _boundary(points: Floats) -> list[Loop]:
    """Loops around the union of rectangles whose corners are ``points`` (4 n, 2), in grains."""
    from d4cad.sketch import Loop

    n = len(points)
    nxt = np.ascontiguousarray(np.roll(np.arange(n, dtype=np.int64).reshape(-1, 4), -1, axis=1).ravel())
    x, y = np.ascontiguousarray(points.T)
    x, y, _, _, sizes, *_ = arranged(x, y, np.zeros(n), np.zeros(n, np.bool_), nxt)
    ends = np.cumsum(sizes)[:-1]
    return [
        Loop.polyline(list(zip(px.tolist(), py.tolist(), strict=True)))
        for px, py in zip(np.split(x, ends), np.split(y, ends), strict=True)
    ]


def separate(rects: Floats) -> tuple[Sketch, ...]:
    """Each rectangle of positive size as a sketch."""
    from d4cad.sketch import Loop, Sketch

    whole = rects[(rects[:, 2] > 0) & (rects[:, 3] > 0)]
    loops = [Loop.polyline([(float(x), float(y)) for x, y in four]) for four in corners(whole)]
    return tuple(Sketch.from_loops([loop], "world") for loop in loops)
