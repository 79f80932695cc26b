"""What a trial of a rewrite sees: the base program, and the edges that matter in the window of one rewrite; in pixels.

The edges that a rewrite leaves alone are cut and measured once for all trials; in a window only those are drawn that
can reach it, and of the ones on its left only the winding number counts.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from d4cad.program import Floats
from d4cad.raster.band import NUMBERS, error_of, same_pixel, squared_error
from d4cad.raster.pieces import COLUMNS, cut_edge, edge_table, fill_edge, monotone_pieces
from d4cad.raster.scan import Rows, enter, scan_rows

Ints = NDArray[np.int64]


class Linked(NamedTuple):
    """Linked loops: vertices, bulge and kind of the edge from each, the next vertex and the one before, (n,) each."""

    x: Floats
    y: Floats
    b: Floats
    arc: NDArray[np.bool_]
    nxt: Ints
    prv: Ints


class Picture(NamedTuple):
    """target (height, width), the sums over its rows of 1 - 2 t and t^2, (height, width + 1) each, and the slack of its
    error; as in a SquaresTable."""

    target: Floats
    runs: Floats
    squares: Floats
    slack: float


class Base(NamedTuple):
    """The program that rewrites are tried on: its loops, its edges as the raster cuts them, and its band.

    first: (height + 1,) the first band pixel of each row; first_span: likewise of its spans.
    """

    loops: Linked
    table: Floats
    owner: Ints
    ends: Floats
    pieces: int
    band: Rows
    first: Ints
    first_span: Ints


class Scene(NamedTuple):
    """A window and the edges that matter in it: the first ones move, the rest are the base's.

    moving: (k,) the numbers of the moving edges; table, owner, ends: of all edges, the ``fixed`` pieces of the
    others first and room for the moving ones'; entering: winding number at the left of every row from edges that are
    left of the window; empty: the squared error of no shape.
    """

    r0: int
    r1: int
    c0: int
    c1: int
    moving: Ints
    table: Floats
    owner: Ints
    ends: Floats
    fixed: int
    entering: Floats
    empty: float


@nb.njit(cache=True)
def base_of(loops: Linked, shape: tuple[int, int], ramp: float) -> Base:
    """The base as cut edges and as a band on a canvas of ``shape``."""
    height, width = shape
    n = loops.x.shape[0]
    table = edge_table(loops.x, loops.y, loops.b, loops.nxt)
    owner, ends = np.empty(5 * n, np.int64), np.empty((5 * n, 4))
    pieces = monotone_pieces(table, loops.x, loops.y, loops.nxt, owner, ends)
    band = scan_rows(table, owner, ends, pieces, np.zeros(height), 0, height, 0, width, ramp)
    rows = np.arange(height + 1)
    return Base(
        loops,
        table,
        owner,
        ends,
        pieces,
        band,
        np.searchsorted(band.row, rows),
        np.searchsorted(band.spans[:, 0], rows),
    )


@nb.njit(cache=True)
def base_error(base: Base, picture: Picture, r0: int, r1: int, c0: int, c1: int) -> float:
    """Squared error of the base in a window."""
    target, runs, squares, slack = picture
    row, col, cover, wound, _, _, _, spans, _ = base.band
    total = 0.0
    for r in range(r0, r1):
        total += squares[r, c1] - squares[r, c0]
    for k in range(base.first_span[r0], base.first_span[r1]):
        start, stop = max(spans[k, 1], c0), min(spans[k, 2], c1)
        if start < stop:
            total += runs[spans[k, 0], stop] - runs[spans[k, 0], start]
    for s in range(base.first[r0], base.first[r1]):
        if c0 <= col[s] < c1 and not same_pixel(row, col, s):
            t = target[row[s], col[s]]
            hard = 1.0 - t if wound[s] else t
            total += error_of(cover[s] - t, slack) - hard * hard
    return total


@nb.njit(cache=True)
def moving_edges(loops: Linked, base: Base, columns: Ints) -> Ints:
    """The edges of the changed loops that are not the base's, or that a trial tunes."""
    x, y, b, _, nxt, _ = loops
    old = base.loops
    n = old.x.shape[0]
    found = np.empty(x.shape[0], np.int64)
    count = 0
    for e in range(x.shape[0]):
        end = nxt[e]
        if end == e:
            continue
        same = e < n and end == old.nxt[e] and b[e] == old.b[e] and x[e] == old.x[e] and y[e] == old.y[e]
        if same:
            same = x[end] == old.x[end] and y[end] == old.y[end]
        for k in range(NUMBERS):
            same = same and columns[e, k] < 0
        if not same:
            found[count] = e
            count += 1
    return found[:count]


@nb.njit(cache=True)
def scene_of(
    loops: Linked, base: Base, moving: Ints, picture: Picture, r0: int, r1: int, c0: int, c1: int, ramp: float
) -> Scene:
    """The edges of the base that stay and can be seen in a window, with room for the moving ones."""
    n = base.loops.x.shape[0]
    gone = np.zeros(n, np.bool_)
    for e in range(n):
        gone[e] = loops.nxt[e] == e
    for e in moving:
        if e < n:
            gone[e] = True
    table = np.empty((moving.shape[0] + n, COLUMNS))
    owner = np.empty(base.pieces + 5 * moving.shape[0], np.int64)
    ends = np.empty((owner.shape[0], 4))
    entering = np.zeros(r1 - r0)
    last, edges, fixed = -1, moving.shape[0], 0
    for k in range(base.pieces):
        e = base.owner[k]
        xa, ya, xb, yb = base.ends[k, 0], base.ends[k, 1], base.ends[k, 2], base.ends[k, 3]
        if gone[e] or min(xa, xb) - ramp > c1 or min(ya, yb) - ramp > r1 or max(ya, yb) + ramp < r0:
            continue
        if max(xa, xb) + ramp < c0:
            enter(base.ends, k, r0, r1, ramp, entering)
            continue
        if e != last:
            table[edges] = base.table[e]
            edges += 1
            last = e
        owner[fixed] = edges - 1
        ends[fixed] = base.ends[k]
        fixed += 1
    empty = 0.0
    for r in range(r0, r1):
        empty += picture.squares[r, c1] - picture.squares[r, c0]
    return Scene(r0, r1, c0, c1, moving, table, owner, ends, fixed, entering, empty)


@nb.njit(cache=True)
def render(scene: Scene, loops: Linked, picture: Picture, ramp: float) -> tuple[Rows, float]:
    """The band of a scene with its moving edges as they are now, and its squared error."""
    x, y, b, _, nxt, _ = loops
    pieces = scene.fixed
    for i in range(scene.moving.shape[0]):
        e = scene.moving[i]
        x1, y1 = x[nxt[e]], y[nxt[e]]
        fill_edge(scene.table, i, x[e], y[e], x1, y1, b[e])
        pieces = cut_edge(scene.table, i, x1, y1, scene.owner, scene.ends, pieces)
    band = scan_rows(
        scene.table, scene.owner, scene.ends, pieces, scene.entering, scene.r0, scene.r1, scene.c0, scene.c1, ramp
    )
    error = squared_error(
        picture.target, picture.runs, scene.empty, band.row, band.col, band.cover, band.wound, band.spans,
        picture.slack,
    )  # fmt: skip
    return band, error
