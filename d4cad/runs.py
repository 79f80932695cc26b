"""Which runs of points one line or arc can replace, and the cheapest chain of such runs: compiled.

All arcs from z0 to z1 are the rays of u(q) = (z1 - q) / (q - z0) from 0: an arc of sweep 2 a is the ray at angle a
(inscribed angle theorem). The disc of radius ``tol`` around a point becomes a disc again, because u is a Moebius
map, and the arcs that pass within ``tol`` of the point are the rays that hit it: an interval of a. Intersecting these
intervals gives exactly the arcs that are within ``tol`` of every point of a run.

Arrays here: x, y (n,) float64 points in order; weight (n,) float64, how much a point counts in squared errors; at (m,)
int64, the points at which an edge may end. In a closed curve indices go on past n and m.
"""

from __future__ import annotations

from math import asin, atan2, hypot, inf, pi

import numpy as np
from numba import njit

WIDEST = 0.95 * pi
"""Largest half sweep of one arc: near pi an arc is a circle without a place for its ends."""

ARC_PRICE = 0.02
"""Squared error, as a share of the tolerance squared, that an arc in place of a line must save on the average."""


@njit(cache=True)
def fitted(x, y, weight, first, last, step, tol):
    """The arc from point first to point last within tol of every step-th point between them.

    Returns (half sweep, sum of weighted squared distances); the half sweep is 0 for a line, the error is inf where
    neither fits.
    """
    n = x.size
    ex, ey = x[last % n] - x[first % n], y[last % n] - y[first % n]
    chord = hypot(ex, ey)
    if last - first == 1:
        return 0.0, 0.0
    if chord <= tol:
        for k in range(first + 1, last):
            if hypot(x[k % n] - x[first % n], y[k % n] - y[first % n]) > tol:
                return 0.0, inf
        return 0.0, tol * tol * (last - first)
    low, high = -WIDEST, WIDEST
    seen = False
    middle = 0.0
    total = moment = square = 0.0
    k = first + 1 + ((last - first - 1) % step) // 2
    while k < last:
        i = k % n
        k += step
        px, py = x[i] - x[first % n], y[i] - y[first % n]
        rx, ry = ex - px, ey - py
        near, far = px * px + py * py, rx * rx + ry * ry
        inside = near - tol * tol
        if inside <= 0 or far <= tol * tol:
            continue
        # u = (z1 - q) / (q - z0); its argument is the half sweep of the arc through q
        angle = atan2(ry * px - rx * py, rx * px + ry * py)
        mx = (ex * px + ey * py) / inside - 1
        my = (ey * px - ex * py) / inside
        size = hypot(mx, my)
        spread = chord * tol / inside
        if size <= spread:
            continue
        centre, half = atan2(my, mx), asin(spread / size)
        if not seen:
            seen, middle = True, centre
        turn = 2 * pi * np.round((centre - middle) / (2 * pi))
        centre -= turn
        angle -= 2 * pi * np.round((angle - centre) / (2 * pi))
        low, high = max(low, centre - half), min(high, centre + half)
        if low > high:
            return 0.0, inf
        gain = weight[i] * near * far
        total += gain
        moment += gain * angle
        square += gain * angle * angle
    scale = step / (chord * chord)
    if total <= 0:
        best = min(max(0.0, low), high)
        return best, 0.0
    best = min(max(moment / total, low), high)
    curved = max(square - 2 * best * moment + best * best * total, 0.0) * scale
    if low <= 0 <= high and square * scale <= curved + ARC_PRICE * tol * tol * (last - first):
        return 0.0, square * scale
    return best, curved


@njit(cache=True)
def reaches(x, y, weight, at, must, closed, step_points, tol, patience):
    """What each edge from a candidate end to a later one costs, (m, longest) float64: inf where none fits.

    must (m,) bool: ends that no edge may pass over. step_points: at most about so many points of a run are looked at.
    patience: an edge is given up after so many longer ones in a row did not fit.
    """
    n, m = x.size, at.size
    longest = m - 1
    bound = tol * tol * max(weight.sum(), 1.0)
    cost = np.full((m, longest + 1), inf)
    for a in range(m):
        missed = 0
        for span in range(1, longest + 1):
            b = a + span
            if not closed and b >= m:
                break
            last = at[b % m] + n * (b // m)
            step = 1 + 2 * ((last - at[a]) // (2 * step_points))
            half, error = fitted(x, y, weight, at[a], last, step, tol)
            if error < inf:
                cost[a, span] = 1 + 0.0005 * (half != 0.0) + 0.5 * error / bound
                missed = 0
            elif hypot(x[last % n] - x[at[a]], y[last % n] - y[at[a]]) > 4 * tol:
                missed += 1
                if missed > patience + span // 8:
                    break
            if must[b % m]:
                break
    return cost


@njit(cache=True)
def cheapest(cost, start, end, limit):
    """The cheapest chain of candidate ends from ``start`` to ``end`` (counted on past m), and its cost.

    Chains that cost ``limit`` or more are not followed. Returns (ends, cost); no ends where there is no chain.
    """
    m, spans = cost.shape
    size = end - start + 1
    best = np.full(size, inf)
    before = np.full(size, -1)
    best[0] = 0.0
    for k in range(size - 1):
        if best[k] >= limit:
            continue
        row = cost[(start + k) % m]
        for span in range(1, min(spans, size - k)):
            value = best[k] + row[span]
            if value < best[k + span]:
                best[k + span] = value
                before[k + span] = k
    if not best[size - 1] < limit:
        return np.empty(0, np.int64), inf
    count = 0
    k = size - 1
    while k >= 0:
        count += 1
        k = before[k]
    ends = np.empty(count, np.int64)
    k = size - 1
    while k >= 0:
        count -= 1
        ends[count] = start + k
        k = before[k]
    return ends, best[size - 1]


@njit(cache=True)
def cheapest_ring(cost):
    """The cheapest closed chain over all places to start from, as :func:`cheapest` returns it.

    Some end of the chain lies within the shortest longest reach of any candidate, so that only those are tried.
    """
    m, spans = cost.shape
    shortest, base = m, 0
    for a in range(m):
        reach = 1
        for span in range(1, spans):
            if cost[a, span] < inf:
                reach = span
        if reach < shortest:
            shortest, base = reach, a
    found, price = np.empty(0, np.int64), inf
    for start in range(base, base + shortest + 1):
        ends, value = cheapest(cost, start, start + m, price)
        if value < price:
            found, price = ends, value
    return found, price


@njit(cache=True)
def essential(x, y, first, last, tol, keep):
    """Marks in ``keep`` the points from first to last (counted on past n) that Ramer (1972) and Douglas and Peucker
    (1973) keep at ``tol``."""
    n = x.size
    stack = [(first, last)]
    while stack:
        a, b = stack.pop()
        keep[a % n] = keep[b % n] = True
        x0, y0 = x[a % n], y[a % n]
        ex, ey = x[b % n] - x0, y[b % n] - y0
        length = ex * ex + ey * ey
        worst, place = tol, -1
        for k in range(a + 1, b):
            px, py = x[k % n] - x0, y[k % n] - y0
            t = min(max((px * ex + py * ey) / length, 0.0), 1.0) if length > 0 else 0.0
            d = hypot(px - t * ex, py - t * ey)
            if d > worst:
                worst, place = d, k
        if place >= 0:
            stack.append((a, place))
            stack.append((place, b))


@njit(cache=True)
def farthest(qx, qy, x0, y0, x1, y1, bulge):
    """Largest distance of points (k,) from the nearest of edges (n,), and the point where it is."""
    n = x0.size
    low_x, low_y, high_x, high_y = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        # A box of the chord widened by the sagitta, or the whole circle where the arc is more than half of it.
        b = abs(bulge[i])
        chord = hypot(x1[i] - x0[i], y1[i] - y0[i])
        pad = b * chord / 2 if b <= 1 else chord * (1 + b * b) / (2 * b)
        low_x[i], high_x[i] = min(x0[i], x1[i]) - pad, max(x0[i], x1[i]) + pad
        low_y[i], high_y[i] = min(y0[i], y1[i]) - pad, max(y0[i], y1[i]) + pad
    worst, where, last = 0.0, 0, 0
    for k in range(qx.size):
        x, y = qx[k], qy[k]
        best = distance(x, y, x0[last], y0[last], x1[last], y1[last], bulge[last])
        if best <= worst:
            continue
        for i in range(n):
            dx = max(low_x[i] - x, x - high_x[i], 0.0)
            dy = max(low_y[i] - y, y - high_y[i], 0.0)
            if dx * dx + dy * dy < best * best:
                d = distance(x, y, x0[i], y0[i], x1[i], y1[i], bulge[i])
                if d < best:
                    best, last = d, i
                    if best <= worst:
                        break
        if best > worst:
            worst, where = best, k
    return worst, where


@njit(cache=True)
def distance(x, y, x0, y0, x1, y1, b):
    """Distance of a point from one edge: as :func:`d4cad.edges.distances`."""
    px, py, rx, ry = x - x0, y - y0, x1 - x, y1 - y
    ends = min(hypot(px, py), hypot(rx, ry))
    ex, ey = x1 - x0, y1 - y0
    chord = hypot(ex, ey)
    if chord == 0:
        return ends
    q = 1 + b * b
    wx, wy = (1 - b * b) / q, -2 * b / q
    sine = 2 * b / q
    # (z1 - q) conj(q - z0) w
    ax, ay = rx * px + ry * py, ry * px - rx * py
    value = ax * wy + ay * wx
    root = max(chord * chord + 4 * value * sine, 0.0) ** 0.5
    d = 2 * value / (chord + root)
    # The foot lies on the edge where the point sees its ends so that arc and not complement is between them.
    angle = 2 * np.arctan(b)
    gx = 2 * np.sin(angle) * (x - (x0 + x1) / 2) + ey * np.cos(angle)
    gy = 2 * np.sin(angle) * (y - (y0 + y1) / 2) - ex * np.cos(angle)
    size = hypot(gx, gy)
    if size == 0:
        return abs(d)
    fx, fy = x - d * gx / size, y - d * gy / size
    px, py, rx, ry = fx - x0, fy - y0, x1 - fx, y1 - fy
    # Re((foot - z0) conj((z1 - foot) w)) >= 0
    vx, vy = rx * wx - ry * wy, rx * wy + ry * wx
    return abs(d) if px * vx + py * vy >= 0 else ends
