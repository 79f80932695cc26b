"""From rectangles to exact sketches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d4cad.grammars.arc_line.repair import repair
from d4cad.grammars.union_rect.structure import corners
from d4cad.program import Floats

if TYPE_CHECKING:
    from d4cad.sketch import Sketch


def union(rects: Floats, pixel: float) -> Sketch:
    """The boundary of the union of rectangles (n, 5), in their unit; ``pixel`` is the length under a tenth of which an
    edge is rounding. Holes of under two square pixels are filled.
    """
    from d4cad.sketch import Loop, Sketch

    points = corners(rects[(rects[:, 2] > 0) & (rects[:, 3] > 0)]).reshape(-1, 2) / pixel
    n = len(points)
    nxt = np.arange(n, dtype=np.int64).reshape(-1, 4)
    nxt = np.ascontiguousarray(np.roll(nxt, -1, axis=1).ravel())
    x, y, _, _, sizes, *_ = repair(
        np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1]), np.zeros(n), np.zeros(n, np.bool_), nxt
    )
    loops, start = [], 0
    for size in sizes.tolist():
        part = slice(start, start + size)
        loops.append(Loop.polyline(list(zip((x[part] * pixel).tolist(), (y[part] * pixel).tolist(), strict=True))))
        start += size
    return Sketch.from_loops(loops, "world")


def separate(rects: Floats) -> tuple[Sketch, ...]:
    """Each rectangle of positive size as a sketch."""
    from d4cad.sketch import Loop, Sketch

    whole = rects[(rects[:, 2] > 0) & (rects[:, 3] > 0)]
    loops = [Loop.polyline([(float(x), float(y)) for x, y in four]) for four in corners(whole)]
    return tuple(Sketch.from_loops([loop], "world") for loop in loops)
