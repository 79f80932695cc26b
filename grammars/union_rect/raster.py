"""Scanline kernel: a union of rectangles to the band of pixels near its boundary. All in pixels.

Pixel (row, col) has its centre at (col + 0.5, row + 0.5), y up. Inside and outside come from the rectangles' own rows,
distances from the parts of their sides that bound the union: a side that two rectangles share is no boundary, so a
split leaves no seam.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from d4cad.grammars.union_rect.sides import TOUCH, Floats, Ints, frames, free_parts, normal

AT_SIDE, AT_START, AT_END = 0, 1, 2
"""What a pixel is nearest to: the inside of a free part of a side, or one of its ends."""

Rows = tuple[Any, ...]


@nb.njit(cache=True, inline="always", error_model="numpy")
def _column(x: float) -> int:
    """The first column whose centre is at x or right of it."""
    return math.ceil(x - 0.5)


@nb.njit(cache=True, error_model="numpy")
def _chord(rects: Floats, frame: Floats, i: int, py: float) -> tuple[float, float]:
    """From where to where the height py runs in rectangle i; from > to if it does not."""
    c, s = frame[i, 0], frame[i, 1]
    low, high = -np.inf, np.inf
    dy = py - rects[i, 1]
    for axis in range(2):
        # local u = dx c + dy s, local v = -dx s + dy c, dx the distance from the centre
        slope, at, half = (c, dy * s, rects[i, 2]) if axis == 0 else (-s, dy * c, rects[i, 3])
        if abs(slope) < 1e-13:
            if abs(at) > half:
                return 1.0, 0.0
            continue
        a, b = (-half - at) / slope, (half - at) / slope
        low, high = max(low, min(a, b)), min(high, max(a, b))
    return rects[i, 0] + low, rects[i, 0] + high


@nb.njit(cache=True, error_model="numpy")
def _row_spans(rects: Floats, frame: Floats, rows: Ints, py: float, low: Floats, high: Floats) -> int:
    """The union's runs along the height py, sorted and disjoint, in ``low`` and ``high``; returns how many."""
    count = 0
    for i in rows:
        a, b = _chord(rects, frame, i, py)
        if a >= b:
            continue
        at = count
        while at > 0 and low[at - 1] > a:
            low[at], high[at] = low[at - 1], high[at - 1]
            at -= 1
        low[at], high[at] = a, b
        count += 1
    merged = 0
    for k in range(count):
        if merged > 0 and low[k] <= high[merged - 1] + 2.0 * TOUCH:
            high[merged - 1] = max(high[merged - 1], high[k])
        else:
            low[merged], high[merged] = low[k], high[k]
            merged += 1
    return merged


@nb.njit(cache=True, error_model="numpy")
def scan(rects: Floats, r0: int, r1: int, c0: int, c1: int, ramp: float) -> Rows:
    """The boundary band of a union inside the window of rows [r0, r1) and columns [c0, c1).

    rects: (n, 5); ramp: half-width of the ramp in pixels.

    Returns (row, col, cover, wound, part, where, spans, parts, places): row, col (m,) int32: the pixels nearer than
    ``ramp`` to the boundary; cover (m,): their coverage 1/2 - d / (2 ramp); wound (m,) uint8: 1 inside; part (m,)
    int32: the nearest free part; where (m,) uint8: what of it; spans (k, 3) int64: row, first and past-the-last column
    of runs of inside pixels; parts, places: as `free_parts` returns them.
    """
    frame = frames(rects)
    parts, places = free_parts(rects, frame, -1, -1, True)
    n, count, rows = rects.shape[0], parts.shape[0], r1 - r0

    first = np.zeros(rows + 2, np.int64)
    low_row, high_row = np.zeros(count, np.int64), np.zeros(count, np.int64)
    room = 16.0
    for k in range(count):
        xa, ya = places[k, 0], places[k, 1]
        xb, yb = xa + places[k, 4] * places[k, 2], ya + places[k, 4] * places[k, 3]
        if min(xa, xb) - ramp > c1 or max(xa, xb) + ramp < c0:
            continue
        lo = max(math.ceil(min(ya, yb) - ramp - 0.5), r0)
        hi = min(math.floor(max(ya, yb) + ramp - 0.5) + 1, r1)
        if hi <= lo:
            continue
        low_row[k], high_row[k] = lo, hi
        first[lo - r0 + 1] += 1
        first[hi - r0 + 1] -= 1
        room += 2.0 * (ramp + 0.75) * (abs(xb - xa) + abs(yb - ya) + 2.0 * ramp + 1.5)
    for _ in range(2):  # differences of counts to counts to first positions
        for r in range(rows):
            first[r + 1] += first[r]
    active = np.empty(first[rows], np.int64)
    fill = first[:rows].copy()
    for k in range(count):
        for r in range(low_row[k] - r0, high_row[k] - r0):
            active[fill[r]] = k
            fill[r] += 1

    capacity = min(int(room), rows * (c1 - c0))
    row_of, col_of = np.empty(capacity, np.int32), np.empty(capacity, np.int32)
    cover, gap = np.empty(capacity), np.empty(capacity)
    wound, where = np.empty(capacity, np.uint8), np.empty(capacity, np.uint8)
    part = np.empty(capacity, np.int32)
    spans = np.empty((rows * n + 1, 3), np.int64)
    slot = np.full(c1 - c0, -1, np.int32)
    low, high = np.empty(n), np.empty(n)
    here = np.empty(n, np.int64)
    bottom, top = np.empty(n), np.empty(n)
    for i in range(n):
        tall = rects[i, 2] * abs(frame[i, 1]) + rects[i, 3] * abs(frame[i, 0])
        wide = rects[i, 2] * abs(frame[i, 0]) + rects[i, 3] * abs(frame[i, 1])
        seen = rects[i, 0] + wide >= c0 and rects[i, 0] - wide <= c1
        bottom[i], top[i] = (rects[i, 1] - tall, rects[i, 1] + tall) if seen else (np.inf, -np.inf)
    m = runs = 0

    for r in range(r0, r1):
        py = r + 0.5
        begin = m
        for at in range(first[r - r0], first[r - r0 + 1]):
            k = active[at]
            xa, ya, dx, dy, length = places[k, 0], places[k, 1], places[k, 2], places[k, 3], places[k, 4]
            from_, to = 0.0, length
            if abs(dy) * length > 1e-12:
                a, b = (py - ramp - ya) / dy, (py + ramp - ya) / dy
                from_, to = max(min(a, b), 0.0), min(max(a, b), length)
                if from_ > to:
                    continue
            xl, xh = xa + from_ * dx, xa + to * dx
            if xl > xh:
                xl, xh = xh, xl
            oy = py - ya
            for col in range(max(_column(xl - ramp), c0), min(_column(xh + ramp), c1)):
                ox = col + 0.5 - xa
                u = ox * dx + oy * dy
                at_part = AT_SIDE
                if u < 0.0:
                    d, at_part = math.sqrt(ox * ox + oy * oy), AT_START
                elif u > length:
                    d, at_part = math.hypot(u - length, ox * dy - oy * dx), AT_END
                else:
                    d = abs(ox * dy - oy * dx)
                if d >= ramp:
                    continue
                s = slot[col - c0]
                if s >= 0 and d >= gap[s]:
                    continue
                if s < 0:
                    slot[col - c0] = m
                    row_of[m], col_of[m] = r, col
                    s = m
                    m += 1
                part[s], gap[s], where[s] = k, d, at_part

        crossed = 0
        for i in range(n):
            if bottom[i] <= py <= top[i]:
                here[crossed] = i
                crossed += 1
        crossed = _row_spans(rects, frame, here[:crossed], py, low, high)
        before = runs
        for i in range(crossed):
            a, b = min(max(_column(low[i]), c0), c1), min(max(_column(high[i]), c0), c1)
            if b > a:
                spans[runs, 0], spans[runs, 1], spans[runs, 2] = r, a, b
                runs += 1
        for s in range(begin, m):
            slot[col_of[s] - c0] = -1
            inside = False
            for i in range(before, runs):
                inside = inside or spans[i, 1] <= col_of[s] < spans[i, 2]
            wound[s] = inside
            away = gap[s] / (2.0 * ramp)
            cover[s] = 0.5 + away if inside else 0.5 - away

    return row_of[:m], col_of[:m], cover[:m], wound[:m], part[:m], where[:m], spans[:runs], parts, places


@nb.njit(cache=True, inline="always", error_model="numpy")
def _push(
    rects: Floats, frame: Floats, cut: int, x: float, y: float, amount: float, number: int, slope: Floats, s: int
) -> None:
    """Add to row s of ``slope`` the outward speed of a side at its point (x, y) by its rectangle's five numbers, times
    ``amount``. ``number``: pixels per unit of length."""
    i, k = cut // 4, cut % 4
    nx, ny = normal(frame, i, k)
    slope[s, 0] += amount * number * nx
    slope[s, 1] += amount * number * ny
    slope[s, 2 + k % 2] += amount * number
    # A turn moves the point along its left perpendicular about the centre.
    slope[s, 4] += amount * ((x - rects[i, 0]) * ny - (y - rects[i, 1]) * nx)


@nb.njit(cache=True, error_model="numpy")
def slopes(rects: Floats, band: Rows, ramp: float, unit: float, free: int) -> tuple[Any, ...]:
    """Derivatives of the coverage of a band from :func:`scan`; ``unit``: pixels per unit of length by which it is
    differentiated; left 0 for all but the first ``free`` rectangles.

    Returns (rect, slope, twin, twin_rect, twin_slope): rect (m,) int32 and slope (m, 5): the rectangle nearest to each
    pixel and the derivative by its numbers; twin (k,) int64: the pixels that are nearest to a corner where the sides of
    two rectangles cross; twin_rect (k,), twin_slope (k, 5): the other rectangle there and the derivative by its
    numbers.

    By the envelope theorem only the motion of the nearest point q counts: at a side its outward speed, and at a corner
    between sides a and b, which q must stay on, with w = A n_a + B n_b the unit vector from q to the pixel, the speed
    along w is A times that of side a plus B times that of side b.
    """
    row, col, wound, part, where, parts, places = band[0], band[1], band[3], band[4], band[5], band[7], band[8]
    frame = frames(rects)
    count = row.shape[0]
    rect, slope = np.empty(count, np.int32), np.zeros((count, 5))
    corners = 0
    for s in range(count):
        corners += where[s] != AT_SIDE
    twin, twin_rect, twin_slope = np.empty(corners, np.int64), np.empty(corners, np.int32), np.zeros((corners, 5))
    twins = 0
    per_ramp = 0.5 / ramp
    for s in range(count):
        k = part[s]
        i = parts[k, 0]
        own = 4 * i + parts[k, 1]
        rect[s] = i
        if i >= free and where[s] == AT_SIDE:
            continue
        px, py = col[s] + 0.5, row[s] + 0.5
        dx, dy, length = places[k, 2], places[k, 3], places[k, 4]
        if where[s] == AT_SIDE:
            u = (px - places[k, 0]) * dx + (py - places[k, 1]) * dy
            _push(rects, frame, own, places[k, 0] + u * dx, places[k, 1] + u * dy, per_ramp, unit, slope, s)
            continue
        at_end = where[s] == AT_END
        qx = places[k, 0] + (length * dx if at_end else 0.0)
        qy = places[k, 1] + (length * dy if at_end else 0.0)
        d = math.hypot(px - qx, py - qy)
        if d == 0.0:  # the direction is taken to be 0
            continue
        wx, wy = (px - qx) / d, (py - qy) / d
        cut = parts[k, 3] if at_end else parts[k, 2]
        j = cut // 4
        ax, ay = dy, -dx
        bx, by = normal(frame, j, cut % 4)
        det = ax * by - ay * bx
        grow = -per_ramp if wound[s] else per_ramp
        if abs(det) < 1e-6:
            _push(rects, frame, own, qx, qy, grow * (wx * ax + wy * ay), unit, slope, s)
            continue
        _push(rects, frame, own, qx, qy, grow * (wx * by - wy * bx) / det, unit, slope, s)
        share = grow * (ax * wy - ay * wx) / det
        if j == i:
            _push(rects, frame, cut, qx, qy, share, unit, slope, s)
        else:
            twin[twins], twin_rect[twins] = s, j
            _push(rects, frame, cut, qx, qy, share, unit, twin_slope, twins)
            twins += 1
    return rect, slope, twin[:twins], twin_rect[:twins], twin_slope[:twins]


@nb.njit(cache=True, error_model="numpy")
def entries(
    band: Rows, rect: NDArray[np.int32], slope: Floats, twin: Ints, twin_rect: NDArray[np.int32], twin_slope: Floats
) -> tuple[NDArray[np.int32], NDArray[np.int32], Floats, NDArray[np.uint8], NDArray[np.int32], Floats]:
    """The band's pixels with what :func:`slopes` gives, one that two rectangles move taking two entries.

    Returns row, col, cover, wound, rect, slope, as :class:`d4cad.raster.band.Band` has them.
    """
    n = rect.shape[0] + twin.shape[0]
    row, col = np.empty(n, np.int32), np.empty(n, np.int32)
    cover, wound = np.empty(n), np.empty(n, np.uint8)
    owner, by = np.empty(n, np.int32), np.empty((n, slope.shape[1]))
    used = k = 0
    for s in range(rect.shape[0]):
        row[used], col[used], cover[used], wound[used] = band[0][s], band[1][s], band[2][s], band[3][s]
        owner[used], by[used] = rect[s], slope[s]
        used += 1
        if k < twin.shape[0] and twin[k] == s:
            row[used], col[used], cover[used], wound[used] = band[0][s], band[1][s], band[2][s], band[3][s]
            owner[used], by[used] = twin_rect[k], twin_slope[k]
            used += 1
            k += 1
    return row, col, cover, wound, owner, by
