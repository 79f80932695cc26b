"""Exact area coverage: the share of every pixel that loops of lines and arcs cover, in closed form; all in pixels.

By Green's theorem the area of a region inside a pixel is a sum over the pieces of its boundary there: each *cut*, the
part of an edge inside one pixel, covers what lies right of it in its own pixel, and by its height every pixel further
right. Under an arc the chord's trapezium is completed by the circular segment (r^2 / 2) (theta - sin theta). No
other approximation is made. (Cells summed row by row are the classical way of antialiasing rasterisers: R. Levien and
D. Turner's FreeType "smooth" rasteriser, which knows polygons only, https://freetype.org.)

The derivative of a pixel's coverage is the integral over its cuts of the boundary's outward motion. With p = q - z0
along an edge from z0 to z1 = z0 + C, a point moves by (1 - p / C) dz0 + (p / C) dz1 at constant bulge, so that only
the integrals of conj(dp) and of p conj(dp) are needed; both are closed forms of a cut's ends and of its segment's area.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from numpy.typing import NDArray

from d4cad.raster.pieces import BULGE, CX, LENGTH, RADIUS, SX, X0, Y0, x_at, y_at

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bytes = NDArray[np.int32]

FULL = 1.0 + 1e-9
"""Coverage that counts as more than the whole pixel: loops lie on each other there, and no motion shows."""
STRAIGHT = 1e-6
"""Under this bulge a cut is straight as far as the derivative by the bulge is concerned."""


@nb.njit(cache=True, inline="always", error_model="numpy")
def _segment(chord2: float, s: float) -> float:
    """Area between an arc of at most a quarter turn and its chord: chord^2 (h - sin h cos h) / (4 sin^2 h), s = sin h
    for h half the sweep; its series where that cancels."""
    if s < 0.1:
        q = s * s
        return chord2 * s * (1 / 6 + q * (1 / 20 + q * (3 / 112 + q * 5 / 288)))
    return chord2 * (math.asin(s) - s * math.sqrt(1.0 - s * s)) / (4.0 * s * s)


@nb.njit(cache=True, inline="always", error_model="numpy")
def _sine(table: Floats, e: int, chord2: float) -> float:
    """Sine of half the sweep of the part of edge e over a chord of that square."""
    b = abs(table[e, BULGE])
    return min(b * math.sqrt(chord2) / table[e, RADIUS], 1.0) if b > 0.0 else 0.0


@nb.njit(cache=True, error_model="numpy")
def enter_heights(ya: float, yb: float, r0: int, r1: int, entering: Floats) -> None:
    """Add to ``entering`` (r1 - r0,) what a monotone curve from height ya to yb, all left of a window of those rows,
    covers of each row: heights, > 0 going down."""
    low, high, sign = (ya, yb, -1.0) if ya < yb else (yb, ya, 1.0)
    low, high = max(low, float(r0)), min(high, float(r1))
    row = int(low)
    while low < high:
        top = min(high, row + 1.0)
        entering[row - r0] += sign * (top - low)
        low = top
        row += 1


@nb.njit(cache=True, error_model="numpy")
def cuts(
    table: Floats, owner: Ints, ends: Floats, pieces: int, entering: Floats, r0: int, r1: int, c0: int, c1: int
) -> tuple[Bytes, Bytes, Bytes, Floats]:
    """The cuts of monotone pieces inside a window: row, col, edge (m,) and ends (m, 4) along the travel, unsorted.

    What passes left of the window is added to ``entering``.
    """
    room = 16.0
    for k in range(pieces):
        xa, ya, xb, yb = ends[k, 0], ends[k, 1], ends[k, 2], ends[k, 3]
        across = min(max(xa, xb), float(c1)) - max(min(xa, xb), float(c0))
        along = min(max(ya, yb), float(r1)) - max(min(ya, yb), float(r0))
        if along >= 0.0 and across >= 0.0:
            room += across + along + 4.0
    row, col, edge = np.empty(int(room), np.int32), np.empty(int(room), np.int32), np.empty(int(room), np.int32)
    cut = np.empty((int(room), 4))
    m = 0
    for k in range(pieces):
        xa, ya, xb, yb = ends[k, 0], ends[k, 1], ends[k, 2], ends[k, 3]
        if min(xa, xb) >= c1 or max(ya, yb) < r0 or min(ya, yb) >= r1:
            continue
        if max(xa, xb) <= c0:
            enter_heights(ya, yb, r0, r1, entering)
            continue
        e = owner[k]
        up = yb >= ya
        x0, y0 = xa, ya
        if up and ya < r0:
            y0 = float(r0)
            x0 = x_at(table, e, ends, k, y0)
        elif not up and ya > r1:
            y0 = float(r1)
            x0 = x_at(table, e, ends, k, y0)
        r = math.floor(y0) if up else math.ceil(y0) - 1
        while r0 <= r < r1:
            y1 = min(r + 1.0, yb) if up else max(float(r), yb)
            x1 = xb if y1 == yb else x_at(table, e, ends, k, y1)
            if max(x0, x1) <= c0:
                entering[r - r0] -= y1 - y0
            elif min(x0, x1) < c1:
                x, y = x0, y0
                right = x1 >= x0
                if right and x < c0:
                    x = float(c0)
                    y = y_at(table, e, ends, k, x)
                    entering[r - r0] -= y - y0
                elif not right and x > c1:
                    x = float(c1)
                    y = y_at(table, e, ends, k, x)
                c = math.floor(x) if right else math.ceil(x) - 1
                while True:
                    if c >= c1:
                        break
                    if c < c0:
                        entering[r - r0] -= y1 - y
                        break
                    xn = min(c + 1.0, x1) if right else max(float(c), x1)
                    yn = y1
                    if xn != x1:
                        yn = y_at(table, e, ends, k, xn)
                        yn = min(max(yn, y), y1) if up else max(min(yn, y), y1)
                    row[m], col[m], edge[m] = r, c, e
                    cut[m, 0], cut[m, 1], cut[m, 2], cut[m, 3] = x, y, xn, yn
                    m += 1
                    if xn == x1:
                        break
                    x, y = xn, yn
                    c += 1 if right else -1
            if y1 == yb:
                break
            x0, y0 = x1, y1
            r += 1 if up else -1
    return row[:m], col[:m], edge[:m], cut[:m]


@nb.njit(cache=True, error_model="numpy")
def _order(row: Bytes, col: Bytes, r0: int, r1: int, c0: int, c1: int) -> Ints:
    """Positions of the cuts by row, then by column: two passes of a stable counting sort."""
    m = row.shape[0]
    by_col, by_both = np.empty(m, np.int64), np.empty(m, np.int64)
    first = np.zeros(c1 - c0 + 1, np.int64)
    for s in range(m):
        first[col[s] - c0 + 1] += 1
    for c in range(c1 - c0):
        first[c + 1] += first[c]
    for s in range(m):
        by_col[first[col[s] - c0]] = s
        first[col[s] - c0] += 1
    first = np.zeros(r1 - r0 + 1, np.int64)
    for s in range(m):
        first[row[s] - r0 + 1] += 1
    for r in range(r1 - r0):
        first[r + 1] += first[r]
    for k in range(m):
        s = by_col[k]
        by_both[first[row[s] - r0]] = s
        first[row[s] - r0] += 1
    return by_both


@nb.njit(cache=True, error_model="numpy")
def area_band(
    table: Floats, owner: Ints, ends: Floats, pieces: int, entering: Floats, r0: int, r1: int, c0: int, c1: int
) -> tuple[Bytes, Bytes, Floats, Bytes, Floats, Floats, Ints]:
    """The pixels that the boundary crosses with their coverage, one entry for every cut.

    Returns row, col, cover, edge (m,), sign (m,): 1 where coverage grows as the cut moves right of its travel, -1 where
    it falls, 0 where loops lie on each other; the cuts' ends (m, 4); and spans (k, 3) of whole pixels inside.
    """
    entering = entering.copy()
    rows, cols, edges, cut = cuts(table, owner, ends, pieces, entering, r0, r1, c0, c1)
    order = _order(rows, cols, r0, r1, c0, c1)
    m = order.shape[0]
    row, col, edge = np.empty(m, np.int32), np.empty(m, np.int32), np.empty(m, np.int32)
    cover, sign = np.empty(m), np.empty(m)
    sorted_cut = np.empty((m, 4))
    spans = np.empty((m + r1 - r0 + 1, 3), np.int64)
    count = 0
    s = 0
    for r in range(r0, r1):
        wound = entering[r - r0]
        reached = c0
        while s < m and rows[order[s]] == r:
            c = cols[order[s]]
            if c > reached and abs(wound) > 0.5:
                spans[count, 0], spans[count, 1], spans[count, 2] = r, reached, c
                count += 1
            reached = c + 1
            here = wound
            begin = s
            while s < m and rows[order[s]] == r and cols[order[s]] == c:
                at = order[s]
                e = edges[at]
                dx, dy = cut[at, 2] - cut[at, 0], cut[at, 3] - cut[at, 1]
                here -= (c + 1.0 - 0.5 * (cut[at, 0] + cut[at, 2])) * dy
                b = table[e, BULGE]
                if b != 0.0:
                    chord2 = dx * dx + dy * dy
                    here += math.copysign(_segment(chord2, _sine(table, e, chord2)), b)
                wound -= dy
                row[s], col[s], edge[s] = r, c, e
                sorted_cut[s] = cut[at]
                s += 1
            turn = 1.0 if here > -1e-9 else -1.0
            for k in range(begin, s):
                cover[k] = min(abs(here), 1.0)
                sign[k] = turn if abs(here) < FULL else 0.0
        if c1 > reached and abs(wound) > 0.5:
            spans[count, 0], spans[count, 1], spans[count, 2] = r, reached, c1
            count += 1
    return row, col, cover, edge, sign, sorted_cut, spans[:count]


@nb.njit(cache=True, error_model="numpy")
def area_slopes(table: Floats, edge: Bytes, sign: Floats, cut: Floats, unit: float, edges: int) -> Floats:
    """Derivatives (m, 5) of the pixels' coverage by the five numbers of each cut's edge; 0 for all but the first
    ``edges``. unit: pixels per unit of length.

    By the bulge an edge moves along its normal by v_n = 2 (u (L - u) - v^2 + b L v) / (L (1 + b^2)) in the chord's
    frame, which on the circle is v / b; its integral along a cut needs the area under the arc once more.
    """
    m = edge.shape[0]
    slope = np.zeros((m, 5))
    for s in range(m):
        e = edge[s]
        if e >= edges or sign[s] == 0.0:
            continue
        length, b, cx, sx = table[e, LENGTH], table[e, BULGE], table[e, CX], table[e, SX]
        ax, ay = cut[s, 0] - table[e, X0], cut[s, 1] - table[e, Y0]
        bx, by = cut[s, 2] - table[e, X0], cut[s, 3] - table[e, Y0]
        dx, dy = bx - ax, by - ay
        chord2 = dx * dx + dy * dy
        sine = _sine(table, e, chord2)
        swept = 0.5 * (ax * by - ay * bx)
        if b != 0.0:
            swept += math.copysign(_segment(chord2, sine), b)
        # P = integral of p conj(dp); W = P / C = P conj(unit chord) / L; T = conj(D) - W.
        pr = 0.5 * (dx * (ax + bx) + dy * (ay + by))
        pi = -2.0 * swept
        wr = (pr * cx + pi * sx) / length
        wi = (pi * cx - pr * sx) / length
        grow = sign[s] * unit
        slope[s, 0] = -grow * (-dy - wi)
        slope[s, 1] = -grow * (dx - wr)
        slope[s, 2] = -grow * wi
        slope[s, 3] = -grow * wr
        mx, my = 0.5 * (ax + bx), 0.5 * (ay + by)
        chord = math.sqrt(chord2)
        if abs(b) < STRAIGHT:
            # Simpson's rule, exact for the square along a straight cut.
            total = 0.0
            for px, py, weight in ((ax, ay, 1.0), (mx, my, 4.0), (bx, by, 1.0)):
                u = px * cx + py * sx
                total += weight * u * (length - u)
            slope[s, 4] = sign[s] * chord * total / (3.0 * length)
            continue
        q = sine * sine
        if sine < 0.1:
            long = chord * (1.0 + q * (1 / 6 + q * (3 / 40 + q * 5 / 112)))
            under = chord2 * sine * (1 / 6 + q * (1 / 15 + q * (4 / 105 + q * 8 / 315)))
        else:
            half = math.asin(sine)
            long = chord * half / sine
            under = chord2 * (sine - half * math.sqrt(1.0 - q)) / (2.0 * q)
        v = mx * sx - my * cx
        tilt = (dx * cx + dy * sx) / chord if chord > 0.0 else 0.0
        slope[s, 4] = sign[s] * (v * long + math.copysign(under, b) * tilt) / b
    return slope
