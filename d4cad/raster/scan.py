"""Scanline kernel: loops of lines and arcs to the band of pixels near their boundary.

Everything here is in pixels: pixel (row, col) has its centre at (col + 0.5, row + 0.5), y up. An edge runs
from vertex i to vertex nxt[i] with bulge b[i] = tan(sweep / 4); 0 is a line. No formula here divides by the
bulge: with u along the chord from its start and v to the right of travel, the edge's circle is

    f(u, v) = 2 b (u^2 - u L + v^2) + L (1 - b^2) v = 0,    grad f = L (1 + b^2) on the circle

which at b = 0 is the chord's line. f > 0 to the right of travel for either sign of b.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

X0, Y0, CX, SX, LENGTH, BULGE, COS, SIN, RADIUS, FLAT = range(10)
"""Columns of the edge table: start, unit chord, chord length, bulge, cosine and sine of half the sweep, L (1 + b^2) / 2
and L (1 - b^2) / 2."""

AT_EDGE, AT_START, AT_END = 0, 1, 2
"""What a pixel is nearest to: the inside of its edge, or one of its vertices."""

ON_EDGE = 1e-9
"""A pixel centre nearer to its edge than this (px) lies on it: rounding would decide on which side."""


@nb.njit(cache=True, inline="always", error_model="numpy")
def _distance(u, v, length, b, cos, sin, radius, flat):
    """Signed distance to an edge's curve (> 0 right of travel) from the chord frame, and where its foot lies.

    At a vertex the distance is to that vertex, unsigned. The sector of an arc over half a turn is the union, of
    a lesser one the intersection, of the half-planes that its end normals bound.
    """
    after = u * cos + v * sin >= 0.0
    before = (u - length) * cos - v * sin <= 0.0
    if (after and before) or ((after or before) and abs(b) > 1.0):
        f = 2.0 * (b * (u * (u - length) + v * v) + flat * v)
        across, along = b * (2.0 * u - length), 2.0 * b * v + flat
        return f / (radius + math.sqrt(across * across + along * along)), AT_EDGE
    to_start = u * u + v * v
    to_end = (u - length) * (u - length) + v * v
    if to_start <= to_end:
        return math.sqrt(to_start), AT_START
    return math.sqrt(to_end), AT_END


@nb.njit(cache=True, error_model="numpy")
def edge_table(x, y, b, nxt):
    """Constants of every edge, (n, 10), columns as named above. Chords under 1e-9 px count as 1e-9 px long."""
    n = x.shape[0]
    table = np.empty((n, 10))
    for e in range(n):
        dx = x[nxt[e]] - x[e]
        dy = y[nxt[e]] - y[e]
        length = math.hypot(dx, dy)
        if length < 1e-9:
            dx, dy, length = 1e-9, 0.0, 1e-9
        bb = b[e] * b[e]
        table[e, X0] = x[e]
        table[e, Y0] = y[e]
        table[e, CX] = dx / length
        table[e, SX] = dy / length
        table[e, LENGTH] = length
        table[e, BULGE] = b[e]
        table[e, COS] = (1.0 - bb) / (1.0 + bb)
        table[e, SIN] = 2.0 * b[e] / (1.0 + bb)
        table[e, RADIUS] = 0.5 * length * (1.0 + bb)
        table[e, FLAT] = 0.5 * length * (1.0 - bb)
    return table


@nb.njit(cache=True, error_model="numpy")
def monotone_pieces(table, x, y, nxt, owner, ends):
    """Cut every edge where it runs level or upright; returns the number of pieces.

    ``owner`` (5 n,) int64 and ``ends`` (5 n, 4) are filled with each piece's edge and its xa, ya, xb, yb.
    The tangent turns from phi - h to phi + h, phi the chord's angle and h = 2 atan(b), so the cuts are at the multiples
    of a quarter turn in between; the chord from the start to the point of tangent angle a points to the mean of both
    tangent angles and is L sin((a - a0) / 2) / sin(h) long.
    """
    count = 0
    quarter = 0.5 * math.pi
    for e in range(table.shape[0]):
        xa, ya = x[e], y[e]
        b = table[e, BULGE]
        if abs(b) > 1e-15:  # a flatter arc is nowhere further from its chord than rounding
            half = 2.0 * math.atan(b)
            start = math.atan2(table[e, SX], table[e, CX]) - half
            turn = 2.0 * half
            scale = table[e, LENGTH] / math.sin(half)
            sign = 1.0 if b > 0.0 else -1.0
            k = math.floor(start / quarter) + 1.0 if b > 0.0 else math.ceil(start / quarter) - 1.0
            while sign * (k * quarter - start) < abs(turn):
                delta = k * quarter - start
                reach = scale * math.sin(0.5 * delta)
                xb = x[e] + reach * math.cos(start + 0.5 * delta)
                yb = y[e] + reach * math.sin(start + 0.5 * delta)
                owner[count] = e
                ends[count, 0], ends[count, 1], ends[count, 2], ends[count, 3] = xa, ya, xb, yb
                count += 1
                xa, ya = xb, yb
                k += sign
        owner[count] = e
        ends[count, 0], ends[count, 1] = xa, ya
        ends[count, 2], ends[count, 3] = x[nxt[e]], y[nxt[e]]
        count += 1
    return count


@nb.njit(cache=True, inline="always", error_model="numpy")
def _x_at(table, e, ends, k, py):
    """Where piece k of edge e meets the height py (clamped to the piece's own box).

    f = A X^2 + 2 B X + C in X = x - x0, and A X + B has the sign of the piece's rise because grad f points right of
    travel. The root is taken in whichever form adds numbers of one sign, so that A = 0 is no special case.
    """
    xa, ya, xb, yb = ends[k, 0], ends[k, 1], ends[k, 2], ends[k, 3]
    # At its ends the piece's own numbers: on a nearly level piece the quadratic could land anywhere between them.
    if py <= min(ya, yb):
        return xa if ya <= yb else xb
    if py >= max(ya, yb):
        return xb if ya <= yb else xa
    low, high = (xa, xb) if xa < xb else (xb, xa)
    b = table[e, BULGE]
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
    return min(max(x + table[e, X0], low), high)


@nb.njit(cache=True, inline="always", error_model="numpy")
def _column(x):
    """The first column whose centre is at x or right of it."""
    return math.ceil(x - 0.5)


@nb.njit(cache=True, error_model="numpy")
def scan(x, y, b, nxt, r0, r1, c0, c1, ramp):
    """The boundary band of loops inside the window of rows [r0, r1) and columns [c0, c1).

    x, y, b: (n,) float64 vertices in pixels and bulges; nxt: (n,) int64; ramp: half-width of the ramp in pixels.

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
    rows = r1 - r0

    # Pieces of every row, as one array and the rows' first positions in it; a piece wholly right of the window can
    # neither be near a pixel nor be crossed on the way in from the left.
    first = np.zeros(rows + 1, np.int64)
    low_row = np.empty(pieces, np.int64)
    high_row = np.empty(pieces, np.int64)
    room = 16.0
    for k in range(pieces):
        ya, yb = ends[k, 1], ends[k, 3]
        bottom, top = (ya, yb) if ya < yb else (yb, ya)
        left = min(ends[k, 0], ends[k, 2])
        lo = max(math.ceil(bottom - ramp - 0.5), r0)
        hi = min(math.floor(top + ramp - 0.5) + 1, r1)
        if left - ramp > c1 or hi <= lo:
            lo = hi = r0
        low_row[k] = lo
        high_row[k] = hi
        for r in range(lo, hi):
            first[r - r0 + 1] += 1
        if hi > lo:
            # The quarter turn of an arc is at most sqrt(2) chords long: |dx| + |dy| bounds it.
            reach = abs(ends[k, 2] - ends[k, 0]) + min(top, float(r1) + ramp) - max(bottom, float(r0) - ramp)
            room += 2.0 * (ramp + 0.75) * (max(reach, 0.0) + 2.0 * ramp + 1.5)
    for r in range(rows):
        first[r + 1] += first[r]
    active = np.empty(first[rows], np.int64)
    fill = first[:rows].copy()
    for k in range(pieces):
        for r in range(low_row[k], high_row[k]):
            active[fill[r - r0]] = k
            fill[r - r0] += 1

    capacity = min(int(room), rows * (c1 - c0))
    row_of = np.empty(capacity, np.int32)
    col_of = np.empty(capacity, np.int32)
    cover = np.empty(capacity)
    wound = np.empty(capacity, np.uint8)
    edge = np.empty(capacity, np.int32)
    slope = np.empty((capacity, 5))
    spans = np.empty((first[rows] // 2 + rows + 1, 3), np.int64)
    m = 0
    span_count = 0
    slot = np.full(c1 - c0, -1, np.int32)
    gap = np.empty(c1 - c0)
    part = np.empty(c1 - c0, np.uint8)
    crossings = np.empty(first[rows] + 1)
    turns = np.empty(first[rows] + 1, np.int64)

    for r in range(r0, r1):
        py = r + 0.5
        crossed = 0
        begin = m
        for at in range(first[r - r0], first[r - r0 + 1]):
            k = active[at]
            e = owner[k]
            ya, yb = ends[k, 1], ends[k, 3]
            bottom, top = (ya, yb) if ya < yb else (yb, ya)
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
            # Within the ramp's reach in height the monotone piece stays between its x at both ends of that reach.
            xl = _x_at(table, e, ends, k, max(bottom, py - ramp))
            xh = _x_at(table, e, ends, k, min(top, py + ramp))
            if ya == yb:
                xl, xh = ends[k, 0], ends[k, 2]
            if xl > xh:
                xl, xh = xh, xl
            length, b_e, cos, sin = table[e, LENGTH], table[e, BULGE], table[e, COS], table[e, SIN]
            radius, flat = table[e, RADIUS], table[e, FLAT]
            cx, sx = table[e, CX], table[e, SX]
            dx0, dy = 0.5 - table[e, X0], py - table[e, Y0]
            for col in range(max(_column(xl - ramp), c0), min(_column(xh + ramp), c1)):
                dx = col + dx0
                d, where = _distance(dx * cx + dy * sx, dx * sx - dy * cx, length, b_e, cos, sin, radius, flat)
                if abs(d) >= ramp:
                    continue
                s = slot[col - c0]
                if s >= 0 and abs(d) >= abs(gap[col - c0]):
                    continue
                if s < 0:
                    slot[col - c0] = m
                    row_of[m] = r
                    col_of[m] = col
                    s = m
                    m += 1
                edge[s] = e
                gap[col - c0] = d
                part[col - c0] = where

        turn = 0
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
            col = col_of[s]
            slot[col - c0] = -1
            px = col + 0.5
            turn = 0
            for i in range(crossed):
                if crossings[i] <= px:
                    turn += turns[i]
            inside = turn != 0
            wound[s] = inside
            d = gap[col - c0]
            cover[s] = 0.5 + (abs(d) if inside else -abs(d)) / (2.0 * ramp)
            _slope(table, edge[s], px, py, d, part[col - c0], inside, ramp, slope, s)

    return row_of[:m], col_of[:m], cover[:m], wound[:m], edge[:m], slope[:m], spans[:span_count]


@nb.njit(cache=True, inline="always", error_model="numpy")
def _slope(table, e, px, py, d, where, inside, ramp, slope, s):
    """Derivatives of a pixel's coverage by its edge's five numbers, into row s of ``slope`` (m, 5).

    By the envelope theorem only the motion of the foot along the normal counts. Moving an end at constant bulge
    turns and scales the edge about the other end: the foot at zeta = (q - z0) / (z1 - z0) moves by (1 - zeta) dz0 +
    zeta dz1. The bulge moves it along the normal by -f_b / |grad f|.
    """
    length, b, cx, sx = table[e, LENGTH], table[e, BULGE], table[e, CX], table[e, SX]
    dx, dy = px - table[e, X0], py - table[e, Y0]
    u, v = dx * cx + dy * sx, dx * sx - dy * cx
    for k in range(5):
        slope[s, k] = 0.0
    if where != AT_EDGE:
        # d = |pixel - vertex|; coverage = 1/2 -+ d / (2 ramp). At d = 0 the direction is taken to be 0.
        at = 0 if where == AT_START else 2
        if where == AT_END:
            u -= length
        if d > 0.0:
            grow = (-1.0 if inside else 1.0) / (2.0 * ramp * d)
            slope[s, at] = grow * (u * cx + v * sx)
            slope[s, at + 1] = grow * (u * sx - v * cx)
        return
    # Unit normal right of travel at the foot, in the chord's frame: grad f at the pixel has its direction.
    nu = b * (2.0 * u - length)
    nv = 2.0 * b * v + table[e, FLAT]
    size = math.sqrt(nu * nu + nv * nv)
    if size > 0.0:
        nu /= size
        nv /= size
    else:
        nu, nv = 0.0, 1.0
    qu = u - d * nu
    qv = v - d * nv
    # sdf = d where the inside is left of travel, else -d; on the edge itself the inside counts as left.
    left = (d <= 0.0) == inside or abs(d) < ON_EDGE
    grow = (1.0 if left else -1.0) / (2.0 * ramp)  # coverage grows when the edge moves along n
    nx = grow * (nu * cx + nv * sx)
    ny = grow * (nu * sx - nv * cx)
    # zeta in complex numbers with the imaginary axis left of the chord: (qu - i qv) / L; n likewise is nx + i ny.
    zr = qu / length
    zi = -qv / length
    end_x = nx * zr + ny * zi
    end_y = ny * zr - nx * zi
    slope[s, 0] = nx - end_x
    slope[s, 1] = ny - end_y
    slope[s, 2] = end_x
    slope[s, 3] = end_y
    slope[s, 4] = -grow * (qu * (qu - length) + qv * qv - b * length * qv) / table[e, RADIUS]
