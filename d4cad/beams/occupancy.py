"""Which elements of a grid an outline fills."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from d4cad.objectives.fem import Grid
from d4cad.sketch import Sketch

Bools = NDArray[np.bool_]


def solid_elements(sketch: Sketch, grid: Grid, side: float) -> Bools:
    """The elements (height, width) whose centre lies inside a sketch, by its exact lines and arcs.

    side: of an element, in the sketch's unit; the grid's lower left corner is the sketch's (0, 0).
    """
    from d4cad.raster.scan import scan

    found = np.zeros((grid.height, grid.width), dtype=np.bool_)
    if not sketch.faces:
        return found
    sizes = np.array([len(loop.points) for loop in sketch.loops])
    points = np.array([point for loop in sketch.loops for point in loop.points]) / side
    bulges = np.array([bulge for loop in sketch.loops for bulge in loop.bulges], dtype=np.float64)
    after = np.arange(1, sizes.sum() + 1)
    ends = np.cumsum(sizes)
    after[ends - 1] = ends - sizes
    x, y = np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1])
    spans = scan(x, y, bulges, after, 0, grid.height, 0, grid.width, 0.5)[-1]
    for row, first, past in spans:
        found[row, first:past] = True
    return found
