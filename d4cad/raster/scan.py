"""Scanline kernel: loops of lines and arcs to the band of pixels near their boundary.

Everything here is in pixels: pixel (row, col) has its centre at (col + 0.5, row + 0.5), y up. An edge runs
from vertex i to vertex nxt[i] with bulge b[i] = tan(sweep / 4); 0 is a line. No formula here divides by the
bulge: with u along the chord from its start and v to the right of travel, the edge's circle is

    f(u, v) = 2 b (u^2 - u L + v^2) + L (1 - b^2) v = 0,    |grad f| = L (1 + b^2) + 4 b d at the distance d from it

which at b = 0 is the chord's line. f > 0 to the right of travel for either sign of b.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

X0, Y0, CX, SX, LENGTH, BULGE, COS, SIN, RADIUS, FLAT, PER_LENGTH, PER_RADIUS = range(12)
"""Columns of the edge table: start, unit chord, chord length L, bulge, cosine and sine of half the sweep,
L (1 + b^2) / 2 and L (1 - b^2) / 2, and the inverses of L and of L (1 + b^2) / 2."""

COLUMNS = 12
"""Number of columns of the edge table."""

AT_EDGE, AT_START, AT_END = 0, 1, 2
"""What a pixel is nearest to: the inside of its edge, or one of its vertices."""

ON_EDGE = 1e-9
"""A pixel centre nearer to its edge than this (px) lies on it: rounding would decide on which side."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Rows = tuple[Any, ...]
"""Arrays of one entry per band pixel, as :func:`scan_rows` returns them."""


@nb.njit(cache=True, inline="always", error_model="numpy")
def _distance(
    u: float, v: float, length: float, b: float, cos: float, sin: float, radius: float, flat: float
) -> tuple[float, int]:
    """Signed distance to an edge's curve (> 0 right of travel) from the chord frame, and where its foot lies.

    At a vertex the distance is to that vertex, unsigned. The sector of an arc over half a turn is the union, of
    a lesser one the intersection, of the half-planes that its end normals bound.
    """
    after = u * cos + v * sin >= 0.0
    before = (u - length) * cos - v * sin <= 0.0
    if (after and before) or ((after or before) and abs(b) > 1.0):
        if b == 0.0:
            return v, AT_EDGE
        f = 2.0 * (b * (u * (u - length) + v * v) + flat * v)
        across, along = b * (2.0 * u - length), 2.0 * b * v + flat
        return f / (radius + math.sqrt(across * across + along * along)), AT_EDGE
    to_start = u * u + v * v
    to_end = (u - length) * (u - length) + v * v
    if to_start <= to_end:
        return math.sqrt(to_start), AT_START
    return math.sqrt(to_end), AT_END


@nb.njit(cache=True, error_model="numpy")
def fill_edge(table: Floats, e: int, x0: float, y0: float, x1: float, y1: float, b: float) -> None:
    """Constants of one edge into row e of the edge table. A chord under 1e-9 px counts as 1e-9 px long."""
    dx = x1 - x0
    dy = y1 - y0
    length = math.sqrt(dx * dx + dy * dy)
    if length < 1e-9:
        dx, dy, length = 1e-9, 0.0, 1e-9
    bb = b * b
    table[e, X0] = x0
    table[e, Y0] = y0
    table[e, CX] = dx / length
    table[e, SX] = dy / length
    table[e, LENGTH] = length
    table[e, BULGE] = b
    table[e, COS] = (1.0 - bb) / (1.0 + bb)
    table[e, SIN] = 2.0 * b / (1.0 + bb)
    table[e, RADIUS] = 0.5 * length * (1.0 + bb)
    table[e, FLAT] = 0.5 * length * (1.0 - bb)
    table[e, PER_LENGTH] = 1.0 / length
    table[e, PER_RADIUS] = 2.0 / (length * (1.0 + bb))


@nb.njit(cache=True, error_model="numpy")
def edge_table(x: Floats, y: Floats, b: Floats, nxt: Ints) -> Floats:
    """Constants of every edge, (n, COLUMNS), columns as named above."""
    n = x.shape[0]
    table = np.empty((n, COLUMNS))
    for e in range(n):
        fill_edge(table, e, x[e], y[e], x[nxt[e]], y[nxt[e]], b[e])
    return table


@nb.njit(cache=True, inline="always", error_model="numpy")
def _turns_past_an_axis(table: Floats, e: int) -> bool:
    """Whether an arc may run level or upright inside: for a sweep of at most half a turn, if the tangents at both ends
    lie in different quadrants."""
    b, cos, sin, cx, sx = table[e, BULGE], table[e, COS], table[e, SIN], table[e, CX], table[e, SX]
    if abs(b) <= 1e-15:  # nowhere further from its chord than rounding
        return False
    level = (cx * cos + sx * sin) * (cx * cos - sx * sin)
    upright = (sx * cos - cx * sin) * (sx * cos + cx * sin)
    return abs(b) > 1.0 or not (level > 0.0 and upright > 0.0)


@nb.njit(cache=True, error_model="numpy")
def cut_edge(table: Floats, e: int, x1: float, y1: float, owner: Ints, ends: Floats, count: int) -> int:
    """Append the monotone pieces of edge e, which ends at (x1, y1), to ``count`` others; returns their new number.

    The tangent turns from phi - h to phi + h, phi the chord's angle and h = 2 atan(b), so the cuts are at the multiples
    of a quarter turn in between; the chord from the start to the point of tangent angle a points to the mean of both
    tangent angles and is L sin((a - a0) / 2) / sin(h) long.
    """
    x0, y0 = table[e, X0], table[e, Y0]
    xa, ya = x0, y0
    if _turns_past_an_axis(table, e):
        quarter = 0.5 * math.pi
        b = table[e, BULGE]
        half = 2.0 * math.atan(b)
        start = math.atan2(table[e, SX], table[e, CX]) - half
        turn = 2.0 * half
        scale = table[e, LENGTH] / math.sin(half)
        sign = 1.0 if b > 0.0 else -1.0
        k = math.floor(start / quarter) + 1.0 if b > 0.0 else math.ceil(start / quarter) - 1.0
        while sign * (k * quarter - start) < abs(turn):
            delta = k * quarter - start
            reach = scale * math.sin(0.5 * delta)
            xb = x0 + reach * math.cos(start + 0.5 * delta)
            yb = y0 + reach * math.sin(start + 0.5 * delta)
            owner[count] = e
            ends[count, 0], ends[count, 1], ends[count, 2], ends[count, 3] = xa, ya, xb, yb
            count += 1
            xa, ya = xb, yb
            k += sign
    owner[count] = e
    ends[count, 0], ends[count, 1], ends[count, 2], ends[count, 3] = xa, ya, x1, y1
    return count + 1


@nb.njit(cache=True, error_model="numpy")
def monotone_pieces(table: Floats, x: Floats, y: Floats, nxt: Ints, owner: Ints, ends: Floats) -> int:
    """Cut every edge where it runs level or upright; returns the number of pieces.

    ``owner`` (5 n,) and ``ends`` (5 n, 4) are filled with each piece's edge and its xa, ya, xb, yb.
    """
    count = 0
    for e in range(table.shape[0]):
        count = cut_edge(table, e, x[nxt[e]], y[nxt[e]], owner, ends, count)
    return count


@nb.njit(cache=True, inline="always", error_model="numpy")
def _x_at(table: Floats, e: int, ends: Floats, k: int, py: float) -> float:
    """Where piece k of edge e meets the height py (clamped to the piece's own box).

    f = A X^2 + 2 B X + C in X = x - x0, and A X + B has the sign of the piece's rise because grad f points right of
    travel. The root is taken in whichever form adds numbers of one sign, so that A = 0 is no special case.
    """
    xa: float = ends[k, 0]
    ya: float = ends[k, 1]
    xb: float = ends[k, 2]
    yb: float = ends[k, 3]
    # At its ends the piece's own numbers: on a nearly level piece the quadratic could land anywhere between them.
    if py <= min(ya, yb):
        return xa if ya <= yb else xb
    if py >= max(ya, yb):
        return xb if ya <= yb else xa
    low, high = (xa, xb) if xa < xb else (xb, xa)
    b = table[e, BULGE]
    if b == 0.0:
        return min(max(xa + (py - ya) * (xb - xa) / (yb - ya), low), high)
    length = table[e, LENGTH]
    rise = py - table[e, Y0]
    a = 2.0 * b
    h = table[e, FLAT] * table[e, SX] - b * length * table[e, CX]
    c = rise * (a * rise - 2.0 * (b * length * table[e, SX] + table[e, FLAT] * table[e, CX]))
    root = math.sqrt(max(h * h - a * c, 0.0))
    if yb < ya:
        root = -root
    if root * h >= 0.0:
        across = root + h
        x = -c / across if across != 0.0 else 0.0
    else:
        x = (root - h) / a
    return float(min(max(x + table[e, X0], low), high))


@nb.njit(cache=True, inline="always", error_model="numpy")
def _column(x: float) -> int:
    """The first column whose centre is at x or right of it."""
    return math.ceil(x - 0.5)


@nb.njit(cache=True, inline="always", error_model="numpy")
def level_range(ends: Floats, k: int, r0: int, r1: int) -> tuple[int, int, int]:
    """The rows [low, high) of [r0, r1) whose centres piece k crosses, half-open upwards; its turn: +1 going down."""
    ya, yb = ends[k, 1], ends[k, 3]
    bottom, top = (ya, yb) if ya < yb else (yb, ya)
    return max(_column(bottom), r0), min(_column(top), r1), 1 if yb < ya else -1


@nb.njit(cache=True, error_model="numpy")
def scan(
    x: Floats, y: Floats, b: Floats, nxt: Ints, r0: int, r1: int, c0: int, c1: int, ramp: float, unit: float = 1.0
) -> Rows:
    """The boundary band of loops inside the window of rows [r0, r1) and columns [c0, c1).

    x, y, b: (n,) float64 vertices in pixels and bulges; nxt: (n,) int64; ramp: half-width of the ramp in pixels; unit:
    pixels per unit of length by which the coverage is differentiated.

    Returns (row, col, cover, wound, edge, slope, spans):
    row, col (m,) int32: the pixels nearer than ``ramp`` to the boundary; cover (m,): their coverage
    1/2 - d / (2 ramp); wound (m,) uint8: 1 where the winding number at the centre is not 0;
    edge (m,) int32: the nearest edge; slope (m, 5): derivative of the coverage by x, y of the edge's start, x, y of its
    end, and its bulge; spans (k, 3) int64: row, first and past-the-last column of runs of non-zero winding.
    """
    n = x.shape[0]
    table = edge_table(x, y, b, nxt)
    owner = np.empty(5 * n, np.int64)
    ends = np.empty((5 * n, 4))
    pieces = monotone_pieces(table, x, y, nxt, owner, ends)
    entering = np.zeros(max(r1 - r0, 0), np.int64)
    band = scan_rows(table, owner, ends, pieces, entering, r0, r1, c0, c1, ramp)
    return band[0], band[1], band[2], band[3], band[4], slopes(table, band, ramp, unit, n), band[7]


@nb.njit(cache=True, error_model="numpy")
def scan_rows(
    table: Floats,
    owner: Ints,
    ends: Floats,
    pieces: int,
    entering: Ints,
    r0: int,
    r1: int,
    c0: int,
    c1: int,
    ramp: float,
) -> Rows:
    """The band of edges that are cut into monotone pieces already.

    table: (n, COLUMNS); owner, ends: the first ``pieces`` rows count; entering: (r1 - r0,) the winding number that
    edges not among these, all left of the window, give every row.

    Returns (row, col, cover, wound, edge, gap, part, spans): as :func:`scan`, and gap (m,), the distance to the nearest
    edge, signed as by the edge; part (m,) uint8, what of the edge is nearest.
    """
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
            lo, hi, turn = level_range(ends, k, r0, r1)
            for r in range(lo, hi):
                entering[r - r0] += turn
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
                here = _x_at(table, e, ends, k, py)
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
                xl = _x_at(table, e, ends, k, max(bottom, py - ramp))
                xh = _x_at(table, e, ends, k, min(top, py + ramp))
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
            for col in range(max(_column(xl), c0), min(_column(xh), c1)):
                dx = col + dx0
                d, where = _distance(dx * cx + dy * sx, dx * sx - dy * cx, length, b_e, cos, sin, radius, flat)
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

        turn = entering[r - r0]
        spans[span_count, 0] = r
        spans[span_count, 1] = c0
        for i in range(crossed):
            before = turn
            turn += turns[i]
            if before == 0 and turn != 0:
                spans[span_count, 0] = r
                spans[span_count, 1] = min(max(_column(crossings[i]), c0), c1)
            elif before != 0 and turn == 0:
                spans[span_count, 2] = min(max(_column(crossings[i]), c0), c1)
                if spans[span_count, 2] > spans[span_count, 1]:
                    span_count += 1
        if turn != 0:
            spans[span_count, 2] = c1
            if c1 > spans[span_count, 1]:
                span_count += 1

        for s in range(begin, m):
            slot[col_of[s] - c0] = -1
            px = col_of[s] + 0.5
            turn = entering[r - r0]
            for i in range(crossed):
                if crossings[i] <= px:
                    turn += turns[i]
            wound[s] = turn != 0
            away = abs(gap[s]) / (2.0 * ramp)
            cover[s] = 0.5 + away if turn != 0 else 0.5 - away

    return row_of[:m], col_of[:m], cover[:m], wound[:m], edge[:m], gap[:m], part[:m], spans[:span_count]


@nb.njit(cache=True, error_model="numpy")
def slopes(table: Floats, band: Rows, ramp: float, unit: float, edges: int) -> Floats:
    """Derivatives (m, 5) of the coverage of a band from :func:`scan_rows` by its edges' five numbers; left 0 for all
    but the first ``edges``.

    By the envelope theorem only the motion of the foot along the normal counts. Moving an end at constant bulge
    turns and scales the edge about the other end: the foot at zeta = (q - z0) / (z1 - z0) moves by (1 - zeta) dz0 +
    zeta dz1. The bulge moves it along the normal by -f_b / |grad f|. At a vertex d = |pixel - vertex|.
    """
    row, col, wound, edge, gap, part = band[0], band[1], band[3], band[4], band[5], band[6]
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
