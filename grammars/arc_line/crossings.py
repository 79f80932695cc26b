"""Where two edges cross, compiled. All in pixels; an edge is one row of the scan kernel's table."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from d4cad.raster.scan import BULGE, CX, FLAT, LENGTH, RADIUS, SX, X0, Y0

SHARED = 1e-4
"""Two edges that share a vertex always meet there: a crossing nearer to it than this (px) is that meeting."""


@nb.njit(cache=True)
def boxes(x, y, owner, ends, pieces, n):
    """True bounding boxes of the edges, (n, 4): low x, low y, high x, high y, from their monotone pieces."""
    box = np.empty((n, 4))
    box[:, 0:2] = np.inf
    box[:, 2:4] = -np.inf
    for k in range(pieces):
        e = owner[k]
        for i in range(2):
            box[e, i] = min(box[e, i], ends[k, i], ends[k, i + 2])
            box[e, i + 2] = max(box[e, i + 2], ends[k, i], ends[k, i + 2])
    return box


@nb.njit(cache=True)
def share(table, e, px, py):
    """How far along the edge a point of it lies, as a share of its length (of its sweep): 0 at the start, 1 at the end.

    On an arc by the inscribed angle: seen from an end, the chord and the point enclose half the sweep between the point
    and the other end. Asked of the farther end, because the direction to a point nearby is mostly rounding.
    """
    dx, dy = px - table[e, X0], py - table[e, Y0]
    u = dx * table[e, CX] + dy * table[e, SX]
    v = dx * table[e, SX] - dy * table[e, CX]
    b, length = table[e, BULGE], table[e, LENGTH]
    if b == 0.0:
        return u / length
    half = 2.0 * math.atan(b)
    if u + u > length:
        return 1.0 - math.atan2(v, u) / half
    return math.atan2(v, length - u) / half


@nb.njit(cache=True, inline="always")
def _implicit(table, e):
    """The edge's curve as k (x^2 + y^2) + 2 gx x + 2 gy y + h = 0 about its own start (h = 0)."""
    b, length = table[e, BULGE], table[e, LENGTH]
    gx = table[e, FLAT] * table[e, SX] - b * length * table[e, CX]
    gy = -table[e, FLAT] * table[e, CX] - b * length * table[e, SX]
    return 2.0 * b, gx, gy


@nb.njit(cache=True)
def meet(table, i, j, points):
    """Intersections of the whole curves (lines or circles) of edges i and j; fills ``points`` (2, 2), returns how many.

    The radical line of both circles meets the more curved one of them; tangent contact counts as none.
    """
    if abs(table[i, BULGE]) * table[j, LENGTH] < abs(table[j, BULGE]) * table[i, LENGTH]:
        i, j = j, i
    # Coordinates about the start of i. Curve i: k p.p + 2 g.p = 0; curve j moved there gains a constant.
    k, gx, gy = _implicit(table, i)
    kj, jx, jy = _implicit(table, j)
    ox, oy = table[j, X0] - table[i, X0], table[j, Y0] - table[i, Y0]
    hj = kj * (ox * ox + oy * oy) - 2.0 * (jx * ox + jy * oy)
    jx -= kj * ox
    jy -= kj * oy
    # Radical line a.p = c: curve j minus ratio times curve i.
    if k != 0.0:
        ratio = kj / k
        ax, ay, c = 2.0 * (jx - ratio * gx), 2.0 * (jy - ratio * gy), -hj
    else:
        ax, ay, c = 2.0 * jx, 2.0 * jy, -hj
    size2 = ax * ax + ay * ay
    if size2 < 1e-24 * (table[i, RADIUS] ** 2 + table[j, RADIUS] ** 2) or size2 == 0.0:
        return 0
    qx, qy = ax * c / size2, ay * c / size2
    dx, dy = -ay / math.sqrt(size2), ax / math.sqrt(size2)
    # On p = q + s d: k s^2 + 2 (k q.d + g.d) s + (k q.q + 2 g.q) = 0.
    half = k * (qx * dx + qy * dy) + gx * dx + gy * dy
    rest = k * (qx * qx + qy * qy) + 2.0 * (gx * qx + gy * qy)
    disc = half * half - k * rest
    if disc <= 1e-14 * (half * half + abs(k * rest)) or (half == 0.0 and k == 0.0):
        return 0
    root = math.sqrt(disc)
    big = -(half + root) if half >= 0.0 else root - half
    count = 0
    for r in range(2):
        if r == 0:
            if big == 0.0:
                continue
            s = rest / big
        else:
            if abs(k) * 1e12 * table[i, LENGTH] < abs(big):
                continue
            s = big / k
        points[count, 0] = table[i, X0] + qx + s * dx
        points[count, 1] = table[i, Y0] + qy + s * dy
        count += 1
    return count


@nb.njit(cache=True)
def crossings(table, x, y, nxt, owner, ends, pieces):
    """All proper crossings of different edges.

    Returns (edge, at, px, py), each crossing as two neighbouring rows 2c and 2c + 1: the edge, the share of it at
    which the crossing lies, and the point.
    """
    n = table.shape[0]
    box = boxes(x, y, owner, ends, pieces, n)
    capacity = 64
    count = 0
    edge = np.empty(2 * capacity, np.int64)
    at = np.empty(2 * capacity)
    px = np.empty(2 * capacity)
    py = np.empty(2 * capacity)
    points = np.empty((2, 2))
    for i in range(n):
        for j in range(i + 1, n):
            if box[i, 0] > box[j, 2] or box[j, 0] > box[i, 2] or box[i, 1] > box[j, 3] or box[j, 1] > box[i, 3]:
                continue
            found = meet(table, i, j, points)
            for r in range(found):
                qx, qy = points[r, 0], points[r, 1]
                if nxt[i] == j and math.hypot(qx - x[j], qy - y[j]) < SHARED:
                    continue
                if nxt[j] == i and math.hypot(qx - x[i], qy - y[i]) < SHARED:
                    continue
                si, sj = share(table, i, qx, qy), share(table, j, qx, qy)
                if not (0.0 < si < 1.0 and 0.0 < sj < 1.0):
                    continue
                if count == capacity:
                    capacity *= 2
                    edge = np.concatenate((edge, np.empty(2 * count, np.int64)))
                    at = np.concatenate((at, np.empty(2 * count)))
                    px = np.concatenate((px, np.empty(2 * count)))
                    py = np.concatenate((py, np.empty(2 * count)))
                c = 2 * count
                edge[c], edge[c + 1] = i, j
                at[c], at[c + 1] = si, sj
                px[c] = px[c + 1] = qx
                py[c] = py[c + 1] = qy
                count += 1
    return edge[: 2 * count], at[: 2 * count], px[: 2 * count], py[: 2 * count]
