"""Scanline kernel: loops of lines and arcs to the band of pixels near their boundary. All in pixels, see pieces.py.

Two edge models: a linear ramp over the distance to the boundary, as the paper has it, and exact area coverage
(area.py), which a ramp of half-width ``AREA`` = 0 stands for.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from d4cad.raster.area import area_band, area_slopes, enter_heights
from d4cad.raster.pieces import (
    AT_EDGE,
    AT_END,
    AT_START,
    BULGE,
    COS,
    CX,
    FLAT,
    LENGTH,
    PER_LENGTH,
    PER_RADIUS,
    RADIUS,
    SIN,
    SX,
    X0,
    Y0,
    column_of,
    distance,
    edge_table,
    level_range,
    monotone_pieces,
    x_at,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

AREA = 0.0
"""The half-width of ramp that stands for exact area coverage."""
ON_EDGE = 1e-9
"""A pixel centre nearer to its edge than this (px) lies on it: rounding would decide on which side."""


class Rows(NamedTuple):
    """The band of pixels nearer than the ramp to the boundary, row by row, and the runs of inside pixels.

    row, col: (m,) int32. cover: (m,) coverage 1/2 - d / (2 ramp). wound: (m,) uint8, 1 where the pixel lies in one of
    the spans. edge: (m,) int32, the nearest edge. gap: (m,) the distance to it, signed as by the edge. part: (m,)
    uint8, what of the edge is nearest. spans: (k, 3) int64, row, first and past-the-last column of runs of non-zero
    winding at the pixels' centres. cut: (0, 4).

    By area coverage the pixels are those that the boundary crosses, with an entry for each of the edges there, one
    after another; gap is then the sign of their motion's effect, cut (m, 4) the part of the edge inside the pixel, and
    the spans, of whole pixels inside, leave the band out.
    """

    row: NDArray[np.int32]
    col: NDArray[np.int32]
    cover: Floats
    wound: NDArray[np.uint8]
    edge: NDArray[np.int32]
    gap: Floats
    part: NDArray[np.uint8]
    spans: Ints
    cut: Floats


@nb.njit(cache=True, error_model="numpy")
def scan(
    x: Floats, y: Floats, b: Floats, nxt: Ints, r0: int, r1: int, c0: int, c1: int, ramp: float, unit: float = 1.0
) -> tuple[NDArray[np.int32], NDArray[np.int32], Floats, NDArray[np.uint8], NDArray[np.int32], Floats, Ints]:
    """The boundary band of loops inside the window of rows [r0, r1) and columns [c0, c1).

    x, y, b: (n,) float64 vertices in pixels and bulges; nxt: (n,) int64; ramp: half-width of the ramp in pixels; unit:
    pixels per unit of length by which the coverage is differentiated.

    Returns row, col, cover, wound and edge as in :class:`Rows`; slope (m, 5), the derivative of the coverage by x, y of
    the edge's start, x, y of its end, and its bulge; and spans.
    """
    n = x.shape[0]
    table = edge_table(x, y, b, nxt)
    owner = np.empty(5 * n, np.int64)
    ends = np.empty((5 * n, 4))
    pieces = monotone_pieces(table, x, y, nxt, owner, ends)
    entering = np.zeros(max(r1 - r0, 0))
    band = scan_rows(table, owner, ends, pieces, entering, r0, r1, c0, c1, ramp)
    slope = slopes(table, band, ramp, unit, n)
    return band.row, band.col, band.cover, band.wound, band.edge, slope, band.spans


@nb.njit(cache=True, error_model="numpy")
def scan_rows(
    table: Floats,
    owner: Ints,
    ends: Floats,
    pieces: int,
    entering: Floats,
    r0: int,
    r1: int,
    c0: int,
    c1: int,
    ramp: float,
) -> Rows:
    """The band of edges that are cut into monotone pieces already.

    table: (n, COLUMNS); owner, ends: the first ``pieces`` rows count; entering: (r1 - r0,) the winding number that
    edges not among these, all left of the window, give every row: at its centre, or on average by area coverage.
    """
    if ramp == AREA:
        row, col, cover, edge, sign, cut, spans = area_band(table, owner, ends, pieces, entering, r0, r1, c0, c1)
        none = np.zeros(row.shape[0], np.uint8)
        return Rows(row, col, cover, none, edge, sign, none, spans, cut)
    band: Rows = _ramp_band(table, owner, ends, pieces, entering, r0, r1, c0, c1, ramp)
    return band


@nb.njit(cache=True, error_model="numpy")
def enter(ends: Floats, k: int, r0: int, r1: int, ramp: float, entering: Floats) -> None:
    """Add to ``entering`` (r1 - r0,) what monotone piece k, all left of a window of those rows, gives each."""
    if ramp == AREA:
        enter_heights(ends[k, 1], ends[k, 3], r0, r1, entering)
        return
    low, high, turn = level_range(ends, k, r0, r1)
    for r in range(low, high):
        entering[r - r0] += turn


@nb.njit(cache=True, error_model="numpy")
def _ramp_band(
    table: Floats,
    owner: Ints,
    ends: Floats,
    pieces: int,
    entering: Floats,
    r0: int,
    r1: int,
    c0: int,
    c1: int,
    ramp: float,
) -> Rows:
    """:func:`scan_rows` by the ramp."""
    rows = r1 - r0

    # Pieces of every row, as one array and the rows' first positions in it; a piece wholly right of the window can
    # neither be near a pixel nor be crossed on the way in from the left, and of one wholly left only the turn counts.
    entering = entering.copy()
    first = np.zeros(rows + 2, np.int64)
    low_row = np.empty(pieces, np.int64)
    high_row = np.empty(pieces, np.int64)
    room = 16.0
    for k in range(pieces):
        ya, yb = ends[k, 1], ends[k, 3]
        bottom, top = (ya, yb) if ya < yb else (yb, ya)
        left, right = (ends[k, 0], ends[k, 2]) if ends[k, 0] < ends[k, 2] else (ends[k, 2], ends[k, 0])
        low_row[k] = high_row[k] = r0
        if left - ramp > c1:
            continue
        if right + ramp < c0:
            enter(ends, k, r0, r1, ramp, entering)
            continue
        lo = max(math.ceil(bottom - ramp - 0.5), r0)
        hi = min(math.floor(top + ramp - 0.5) + 1, r1)
        if hi <= lo:
            continue
        low_row[k], high_row[k] = lo, hi
        first[lo - r0 + 1] += 1
        first[hi - r0 + 1] -= 1
        # A monotone piece is at most |dx| + |dy| long.
        reach = right - left + min(top, float(r1) + ramp) - max(bottom, float(r0) - ramp)
        room += 2.0 * (ramp + 0.75) * (max(reach, 0.0) + 2.0 * ramp + 1.5)
    for _ in range(2):  # differences of counts to counts to first positions
        for r in range(rows):
            first[r + 1] += first[r]
    active = np.empty(first[rows], np.int64)
    fill = first[:rows].copy()
    for k in range(pieces):
        for r in range(low_row[k] - r0, high_row[k] - r0):
            active[fill[r]] = k
            fill[r] += 1

    capacity = min(int(room), rows * (c1 - c0))
    row_of = np.empty(capacity, np.int32)
    col_of = np.empty(capacity, np.int32)
    cover = np.empty(capacity)
    wound = np.empty(capacity, np.uint8)
    edge = np.empty(capacity, np.int32)
    gap = np.empty(capacity)
    part = np.empty(capacity, np.uint8)
    spans = np.empty((first[rows] // 2 + rows + 1, 3), np.int64)
    m = 0
    span_count = 0
    slot = np.full(c1 - c0, -1, np.int32)
    most = 0
    for r in range(rows):
        most = max(most, first[r + 1] - first[r])
    crossings = np.empty(most + 1)
    turns = np.empty(most + 1, np.int64)

    for r in range(r0, r1):
        py = r + 0.5
        crossed = 0
        begin = m
        for at in range(first[r - r0], first[r - r0 + 1]):
            k = active[at]
            e = owner[k]
            ya, yb = ends[k, 1], ends[k, 3]
            bottom, top = (ya, yb) if ya < yb else (yb, ya)
            here = 0.0
            if bottom <= py < top:
                here = x_at(table, e, ends, k, py)
                turn = 1 if yb < ya else -1
                place = crossed
                while place > 0 and crossings[place - 1] > here:
                    crossings[place] = crossings[place - 1]
                    turns[place] = turns[place - 1]
                    place -= 1
                crossings[place] = here
                turns[place] = turn
                crossed += 1
            b_e, sx = table[e, BULGE], table[e, SX]
            if b_e == 0.0 and bottom <= py - ramp and py + ramp <= top:
                # A line passes by: no vertex is near.
                side = ramp / abs(sx)
                xl, xh = here - side, here + side
            else:
                # Within the ramp's reach in height the piece stays between its x at both ends of that reach.
                xl = x_at(table, e, ends, k, max(bottom, py - ramp))
                xh = x_at(table, e, ends, k, min(top, py + ramp))
                if ya == yb:
                    xl, xh = ends[k, 0], ends[k, 2]
                if xl > xh:
                    xl, xh = xh, xl
                xl -= ramp
                xh += ramp
            length, cos, sin = table[e, LENGTH], table[e, COS], table[e, SIN]
            radius, flat = table[e, RADIUS], table[e, FLAT]
            cx = table[e, CX]
            dx0, dy = 0.5 - table[e, X0], py - table[e, Y0]
            for col in range(max(column_of(xl), c0), min(column_of(xh), c1)):
                dx = col + dx0
                d, where = distance(dx * cx + dy * sx, dx * sx - dy * cx, length, b_e, cos, sin, radius, flat)
                if abs(d) >= ramp:
                    continue
                s = slot[col - c0]
                if s >= 0 and abs(d) >= abs(gap[s]):
                    continue
                if s < 0:
                    slot[col - c0] = m
                    row_of[m] = r
                    col_of[m] = col
                    s = m
                    m += 1
                edge[s] = e
                gap[s] = d
                part[s] = where

        turn = int(entering[r - r0])
        spans[span_count, 0] = r
        spans[span_count, 1] = c0
        for i in range(crossed):
            before = turn
            turn += turns[i]
            if before == 0 and turn != 0:
                spans[span_count, 0] = r
                spans[span_count, 1] = min(max(column_of(crossings[i]), c0), c1)
            elif before != 0 and turn == 0:
                spans[span_count, 2] = min(max(column_of(crossings[i]), c0), c1)
                if spans[span_count, 2] > spans[span_count, 1]:
                    span_count += 1
        if turn != 0:
            spans[span_count, 2] = c1
            if c1 > spans[span_count, 1]:
                span_count += 1

        for s in range(begin, m):
            slot[col_of[s] - c0] = -1
            px = col_of[s] + 0.5
            turn = int(entering[r - r0])
            for i in range(crossed):
                if crossings[i] <= px:
                    turn += turns[i]
            wound[s] = turn != 0
            away = abs(gap[s]) / (2.0 * ramp)
            cover[s] = 0.5 + away if turn != 0 else 0.5 - away

    return Rows(
        row_of[:m], col_of[:m], cover[:m], wound[:m], edge[:m], gap[:m], part[:m], spans[:span_count],
        np.empty((0, 4)),
    )  # fmt: skip


@nb.njit(cache=True, error_model="numpy")
def slopes(table: Floats, band: Rows, ramp: float, unit: float, edges: int) -> Floats:
    """Derivatives (m, 5) of the coverage of a band from :func:`scan_rows` by its edges' five numbers; left 0 for all
    but the first ``edges``.

    By the envelope theorem only the motion of the foot along the normal counts. Moving an end at constant bulge
    turns and scales the edge about the other end: the foot at zeta = (q - z0) / (z1 - z0) moves by (1 - zeta) dz0 +
    zeta dz1. The bulge moves it along the normal by -f_b / |grad f|. At a vertex d = |pixel - vertex|.
    """
    row, col, _, wound, edge, gap, part, _, cut = band
    if ramp == AREA:
        exact: Floats = area_slopes(table, edge, gap, cut, unit, edges)
        return exact
    slope = np.zeros((row.shape[0], 5))
    per_ramp = 0.5 / ramp
    for s in range(row.shape[0]):
        e, d, where, inside = edge[s], gap[s], part[s], wound[s] != 0
        if e >= edges:
            continue
        length, b, cx, sx = table[e, LENGTH], table[e, BULGE], table[e, CX], table[e, SX]
        dx, dy = col[s] + 0.5 - table[e, X0], row[s] + 0.5 - table[e, Y0]
        if where != AT_EDGE:
            at = 0 if where == AT_START else 2
            if where == AT_END:
                dx -= length * cx
                dy -= length * sx
            if d > 0.0:  # else the direction is taken to be 0
                grow = (-unit if inside else unit) * per_ramp / d
                slope[s, at] = grow * dx
                slope[s, at + 1] = grow * dy
            continue
        u, v = dx * cx + dy * sx, dx * sx - dy * cx
        # Unit normal right of travel at the foot, in the chord's frame: grad f at the pixel has its direction.
        nu, nv = 0.0, 1.0
        if b != 0.0:
            nu = b * (2.0 * u - length)
            nv = 2.0 * b * v + table[e, FLAT]
            size = math.sqrt(nu * nu + nv * nv)
            per_size = 1.0 / size if size > 0.0 else 0.0
            nu, nv = nu * per_size, nv * per_size
        qu = u - d * nu
        qv = v - d * nv
        # sdf = d where the inside is left of travel, else -d; on the edge itself the inside counts as left.
        left = (d <= 0.0) == inside or abs(d) < ON_EDGE
        grow = per_ramp if left else -per_ramp  # coverage grows when the edge moves along n
        nx = grow * unit * (nu * cx + nv * sx)
        ny = grow * unit * (nu * sx - nv * cx)
        # zeta in complex numbers with the imaginary axis left of the chord: (qu - i qv) / L; n likewise is nx + i ny.
        zr = qu * table[e, PER_LENGTH]
        zi = -qv * table[e, PER_LENGTH]
        end_x = nx * zr + ny * zi
        end_y = ny * zr - nx * zi
        slope[s, 0] = nx - end_x
        slope[s, 1] = ny - end_y
        slope[s, 2] = end_x
        slope[s, 3] = end_y
        slope[s, 4] = -grow * (qu * (qu - length) + qv * qv - b * length * qv) * table[e, PER_RADIUS]
    return slope
