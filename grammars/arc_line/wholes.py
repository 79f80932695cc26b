"""Guards of the rewrites that concern more than the edges at one vertex: slits, and loops that are nearly circles."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from d4cad.grammars.arc_line.curves import apex, arc_length, loop_area

ROUNDNESS = 0.9
"""Least 4 pi A / P^2 of a loop that is proposed to be a circle: an octagon has 0.95, a square 0.79."""


@nb.njit(cache=True)
def circles(x, y, b, nxt, starts):
    """For every loop, of first vertices ``starts`` (k,), the circle of its area about the middle of its bounding box.

    Returns (k, 3): x, y and the radius, < 0 for a clockwise loop, 0 for one that is not nearly round.
    """
    found = np.zeros((starts.shape[0], 3))
    for k in range(starts.shape[0]):
        i = starts[k]
        length = 0.0
        left, right, low, high = np.inf, -np.inf, np.inf, -np.inf
        while True:
            j = nxt[i]
            length += arc_length(x[i], y[i], x[j], y[j], b[i])
            ax, ay = apex(x[i], y[i], x[j], y[j], b[i])
            left, right = min(left, x[i], ax), max(right, x[i], ax)
            low, high = min(low, y[i], ay), max(high, y[i], ay)
            i = j
            if i == starts[k]:
                break
        area = loop_area(x, y, b, nxt, starts[k])
        if 4.0 * math.pi * abs(area) > ROUNDNESS * length * length:
            found[k, 0], found[k, 1] = 0.5 * (left + right), 0.5 * (low + high)
            found[k, 2] = math.copysign(math.sqrt(abs(area) / math.pi), area)
    return found


@nb.njit(cache=True)
def slits(x, y, b, nxt, width):
    """Pairs of nearly straight edges that run side by side in opposite directions, nowhere further apart than
    ``width``.

    Returns i, j (k,) int64 and points (k, 2) bool: whether the start of i and the end of j, and the start of j and
    the end of i, are within ``width``, so that the edge between them would be a point.
    """
    n = x.shape[0]
    first, second = np.empty(n, np.int64), np.empty(n, np.int64)
    points = np.empty((n, 2), np.bool_)
    k = 0
    for i in range(n):
        end = nxt[i]
        ux, uy = x[end] - x[i], y[end] - y[i]
        length = math.hypot(ux, uy)
        if length <= width or abs(b[i]) * length > 2.0 * width:
            continue
        ux, uy = ux / length, uy / length
        for j in range(i + 1, n):
            last = nxt[j]
            size = math.hypot(x[last] - x[j], y[last] - y[j])
            if size <= width or abs(b[j]) * size > 2.0 * width or end == j or last == i or k == n:
                continue
            from_u, to_u = (x[j] - x[i]) * ux + (y[j] - y[i]) * uy, (x[last] - x[i]) * ux + (y[last] - y[i]) * uy
            if from_u - to_u <= 0.9 * size or min(from_u, length) - max(to_u, 0.0) <= width:
                continue
            from_v, to_v = (x[j] - x[i]) * uy - (y[j] - y[i]) * ux, (x[last] - x[i]) * uy - (y[last] - y[i]) * ux
            near, far = max(to_u, 0.0), min(from_u, length)
            slope = (from_v - to_v) / (from_u - to_u)
            if abs(to_v + slope * (near - to_u)) > width or abs(to_v + slope * (far - to_u)) > width:
                continue
            ad = math.hypot(x[i] - x[last], y[i] - y[last]) <= width
            cb = math.hypot(x[end] - x[j], y[end] - y[j]) <= width
            whole = ad and cb and nxt[last] == i and nxt[end] == j  # nothing else in the loop
            if whole or (nxt[last] == i and not ad) or (nxt[end] == j and not cb):
                continue
            first[k], second[k] = i, j
            points[k, 0], points[k, 1] = ad, cb
            k += 1
    return first[:k], second[:k], points[:k]
