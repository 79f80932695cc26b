"""Trials of rewrites, compiled: each is fitted by a few Levenberg-Marquardt steps on its own parameters only, inside
the window that it can change. All in pixels.

The parameters of a trial are the places of the vertices that the rewrite touches, the bulges of the arcs it makes or
changes, and the bulges of the arcs beside them.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from d4cad.grammars.arc_line.rules import NEW_VERTICES, Rule, rewrite, touched
from d4cad.raster.band import normal_equations, squared_error
from d4cad.raster.scan import scan

MARGIN = 4.0
"""Pixels that the window extends beyond the affected edges and their ramp."""
REACH = 6.0
"""The longest step of a vertex (px) in one Levenberg-Marquardt step."""
HOPE = 2.0
"""How many times its last step's progress each remaining step of a trial may make."""
MOST_FREE = 20
"""At most 4 vertices of 2 coordinates, their 4 + 4 edges' bulges, and some room."""


@nb.njit(cache=True)
def _stretch_edge(box, x, y, b, nxt, e):
    """Grow a box (4,) to hold edge e: its ends and apex, padded by what an oblique arc bulges beyond them."""
    x0, y0, x1, y1, bulge = x[e], y[e], x[nxt[e]], y[nxt[e]], b[e]
    half = 0.5 * math.hypot(x1 - x0, y1 - y0)
    pad = 0.11 * half if abs(bulge) <= 1.0 else half * (1.0 + bulge * bulge) / abs(2.0 * bulge)
    pad = pad if bulge != 0.0 else 0.0
    ax = 0.5 * (x0 + x1) + 0.5 * bulge * (y1 - y0)
    ay = 0.5 * (y0 + y1) - 0.5 * bulge * (x1 - x0)
    box[0] = min(box[0], x0 - pad, x1 - pad, ax - pad)
    box[1] = min(box[1], y0 - pad, y1 - pad, ay - pad)
    box[2] = max(box[2], x0 + pad, x1 + pad, ax + pad)
    box[3] = max(box[3], y0 + pad, y1 + pad, ay + pad)


@nb.njit(cache=True)
def solve(matrix, gradient, damping, step):
    """step (n,) with (M + damping diag(M)) step = -gradient, by Cholesky; False if the matrix is not positive."""
    n = matrix.shape[0]
    lower = np.empty((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            if i == j:
                total += damping * matrix[i, i] + 1e-9
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                lower[i, i] = math.sqrt(total)
            else:
                lower[i, j] = total / lower[j, j]
    for i in range(n):
        total = -gradient[i]
        for k in range(i):
            total -= lower[i, k] * step[k]
        step[i] = total / lower[i, i]
    for i in range(n - 1, -1, -1):
        total = step[i]
        for k in range(i + 1, n):
            total -= lower[k, i] * step[k]
        step[i] = total / lower[i, i]
    return True


@nb.njit(cache=True)
def _error(target, runs, squares, band, r0, r1, c0, c1):
    total = 0.0
    for r in range(r0, r1):
        total += squares[r, c1] - squares[r, c0]
    return squared_error(target, runs, total, band[0], band[1], band[2], band[3], band[6])


@nb.njit(cache=True)
def _trial(rule, site, data, cost, shape, room, target, runs, squares, ramp, steps, fit):
    """Gain of one rewrite, the decrease of the squared error less ``cost``, and the number of vertices that it tunes; puts its
    parameters in ``fit`` (MOST_FREE,).

    Ends early, with a loss, when even no error at all in the window would not pay for it, or when a step's progress leaves
    no hope for the remaining ones.

    shape: the base (x, y, b, arc, nxt, prv), (n,) each; room: the same with NEW_VERTICES more, overwritten.
    """
    height, width = target.shape
    n = shape[0].shape[0]
    x, y, b, arc, nxt, prv = room
    x[:n], y[:n], b[:n] = shape[0], shape[1], shape[2]
    arc[:n], nxt[:n], prv[:n] = shape[3], shape[4], shape[5]
    for k in range(n, n + NEW_VERTICES):
        x[k], y[k], b[k], arc[k], nxt[k], prv[k] = -1e7, -1e7, 0.0, False, k, k
    vertices = np.empty(4, np.int64)
    own = np.empty(4, np.int64)
    free, own_count = touched(rule, site, data, nxt, prv, n, vertices, own)

    box = np.array((np.inf, np.inf, -np.inf, -np.inf))
    if rule == Rule.REMOVE_LOOP:
        i = site
        while True:
            _stretch_edge(box, x, y, b, nxt, i)
            i = nxt[i]
            if i == site:
                break
    else:
        for v in vertices[:free]:
            if v < n:
                _stretch_edge(box, x, y, b, nxt, v)
                _stretch_edge(box, x, y, b, nxt, prv[v])
        if rule != Rule.ADD_LOOP:
            _stretch_edge(box, x, y, b, nxt, site)
        if rule == Rule.CLOSE:
            _stretch_edge(box, x, y, b, nxt, nxt[site])
        if rule == Rule.PINCH:
            other = int(data[0])
            for e in (other, nxt[site], nxt[other], prv[site], prv[other]):
                _stretch_edge(box, x, y, b, nxt, e)
    used = rewrite(rule, site, data, x, y, b, arc, nxt, prv, n)
    columns = np.full((n + NEW_VERTICES, 5), -1)
    size = 2 * free
    bulges = np.empty(MOST_FREE, np.int64)
    for k in range(free):
        v = vertices[k]
        p = prv[v]
        _stretch_edge(box, x, y, b, nxt, v)
        columns[v, 0], columns[v, 1] = 2 * k, 2 * k + 1
        columns[p, 2], columns[p, 3] = 2 * k, 2 * k + 1
    for k in range(own_count):
        e = own[k]
        _stretch_edge(box, x, y, b, nxt, e)
        if arc[e] and columns[e, 4] < 0:
            columns[e, 4] = size
            bulges[size] = e
            size += 1
    for k in range(free):
        for e in (vertices[k], prv[vertices[k]]):
            if arc[e] and columns[e, 4] < 0:
                columns[e, 4] = size
                bulges[size] = e
                size += 1
    pad = MARGIN + ramp
    c0, r0 = max(math.floor(max(box[0], 0.0) - pad), 0), max(math.floor(max(box[1], 0.0) - pad), 0)
    c1 = min(math.ceil(min(box[2], float(width)) + pad), width)
    r1 = min(math.ceil(min(box[3], float(height)) + pad), height)
    if r1 <= r0 or c1 <= c0:  # nothing of it is on the canvas: a loop there costs only its price
        return -cost if rule == Rule.REMOVE_LOOP else -1.0, free

    band = scan(shape[0], shape[1], shape[2], shape[4], r0, r1, c0, c1, ramp)
    base = _error(target, runs, squares, band, r0, r1, c0, c1) - cost
    if base <= 0.0:
        return base, free
    x, y, b, nxt = x[:used], y[:used], b[:used], nxt[:used]
    band = scan(x, y, b, nxt, r0, r1, c0, c1, ramp)
    value = _error(target, runs, squares, band, r0, r1, c0, c1)
    matrix = np.empty((size, size))
    gradient = np.empty(size)
    step = np.empty(size)
    before = np.empty(size)
    for k in range(size):
        before[k] = b[bulges[k]] if k >= 2 * free else (x[vertices[k // 2]] if k % 2 == 0 else y[vertices[k // 2]])
    damping = 1e-3
    fresh = True
    for taken in range(steps if size > 0 else 0):
        if fresh:
            matrix[:] = 0.0
            gradient[:] = 0.0
            normal_equations(
                target, runs, 0.0, band[0], band[1], band[2], band[3], band[6],
                band[4], band[5], columns, gradient, matrix,
            )  # fmt: skip
        if not solve(matrix, gradient, damping, step):
            break
        longest = 0.0
        for k in range(2 * free):
            longest = max(longest, abs(step[k]))
        cut = min(1.0, REACH / longest) if longest > 0.0 else 1.0
        for k in range(size):
            now = before[k] + cut * step[k]
            if k >= 2 * free:
                b[bulges[k]] = now
            elif k % 2 == 0:
                x[vertices[k // 2]] = now
            else:
                y[vertices[k // 2]] = now
        tried = scan(x, y, b, nxt, r0, r1, c0, c1, ramp)
        new = _error(target, runs, squares, tried, r0, r1, c0, c1)
        if new < value:
            if taken > 0 and new - HOPE * (steps - taken) * (value - new) > base:
                return base - new, free
            fresh = True
            value, band = new, tried
            damping = max(0.1 * damping, 1e-9)
            for k in range(size):
                before[k] += cut * step[k]
        else:
            fresh = False
            damping *= 10.0
    fit[:size] = before
    return base - value, free


@nb.njit(cache=True)
def trials(rules, sites, data, costs, x, y, b, arc, nxt, prv, target, runs, squares, ramp, steps):
    """Try rewrites one by one on the same base.

    rules, sites: (k,) int64; data: (k, 3); costs: (k,) the squared error each must earn; x, y, b, arc, nxt, prv: (n,) the base in pixels; target (height, width) with
    its row sums ``runs`` and ``squares`` (height, width + 1) of 1 - 2 t and t^2. Returns gain (k,), the decrease of the
    squared error less the cost, free (k,), the number of tuned vertices, and fit (k, MOST_FREE): x, y of those vertices, then the bulges of the own arcs.
    """
    count, n = rules.shape[0], x.shape[0]
    gain = np.empty(count)
    free = np.empty(count, np.int64)
    fit = np.empty((count, MOST_FREE))
    shape = (x, y, b, arc, nxt, prv)
    more = n + NEW_VERTICES
    room = (
        np.empty(more), np.empty(more), np.empty(more),
        np.empty(more, np.bool_), np.empty(more, np.int64), np.empty(more, np.int64),
    )  # fmt: skip
    for k in range(count):
        gain[k], free[k] = _trial(rules[k], sites[k], data[k], costs[k], shape, room, target, runs, squares, ramp, steps, fit[k])
    return gain, free, fit
