"""The raster of primitives that are known by their distances alone: slower than a scan, but any curve will do."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from d4cad.canvas import Canvas
from d4cad.raster.band import NUMBERS, Band, Floats

Field = Callable[[int, Floats, Floats, Floats], Floats]
"""field(i, numbers, x, y): signed distance of points (m,) from primitive i with the given numbers (k,), negative
inside, in world units. It has to be right near the boundary only, and to have the right sign everywhere."""

STEP = 1e-6
"""Half-width of the central differences by which a field is derived."""


def union_of_fields(canvas: Canvas, primitives: Floats, field: Field) -> Band:
    """Coverage of the union of primitives (n, k), k at most 5, and its derivative by all n k numbers, row by row.

    Costs one call of ``field`` with all pixels for each primitive and, for the derivative, 2 k with those near the
    boundary. A canvas of exact area coverage is drawn with a ramp of half a pixel.
    """
    n, k = primitives.shape
    if k > NUMBERS:
        raise ValueError(f"a primitive has at most {NUMBERS} numbers, got {k}")
    ramp = (canvas.ramp or 0.5) * canvas.pixel
    rows, columns = np.indices(canvas.shape).reshape(2, -1)
    x, y = canvas.to_world(np.stack([columns + 0.5, rows + 0.5], axis=1)).T
    nearest, piece = np.full(x.size, np.inf), np.zeros(x.size, np.int32)
    for i, numbers in enumerate(primitives):
        away = field(i, numbers, x, y)
        closer = away < nearest
        nearest[closer], piece[closer] = away[closer], i
    band = np.flatnonzero(np.abs(nearest) < ramp)
    slope = np.zeros((band.size, NUMBERS))
    for i, numbers in enumerate(primitives):
        own = np.flatnonzero(piece[band] == i)
        px, py = x[band[own]], y[band[own]]
        for j in range(k if own.size else 0):
            step = np.where(np.arange(k) == j, STEP, 0.0)
            change = field(i, numbers + step, px, py) - field(i, numbers - step, px, py)
            slope[own, j] = -change / (2 * STEP) / (2 * ramp)
    inside = nearest.reshape(canvas.shape) < 0
    edges = np.diff(np.pad(inside, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    starts, ends = np.argwhere(edges == 1), np.argwhere(edges == -1)
    numbered = np.full((n, NUMBERS), -1, np.int64)
    numbered[:, :k] = np.arange(n * k).reshape(n, k)
    return Band(
        shape=canvas.shape,
        row=rows[band].astype(np.int32),
        col=columns[band].astype(np.int32),
        cover=0.5 - nearest[band] / (2 * ramp),
        wound=inside.ravel()[band].astype(np.uint8),
        piece=piece[band],
        slope=slope,
        columns=numbered,
        spans=np.column_stack([starts, ends[:, 1]]).astype(np.int64),
        size=n * k,
    )
