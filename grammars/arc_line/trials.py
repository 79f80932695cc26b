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
from d4cad.grammars.arc_line.scene import (
    Base,
    Ints,
    Linked,
    Picture,
    Scene,
    base_error,
    base_of,
    moving_edges,
    render,
    scene_of,
)
from d4cad.program import Floats
from d4cad.raster.band import NUMBERS, add_normal_equations
from d4cad.raster.scan import slopes

MARGIN = 4.0
"""Pixels that the window extends beyond the affected edges and their ramp."""
REACH = 6.0
"""The longest step of a vertex (px) in one Levenberg-Marquardt step."""
HOPE = 2.0
"""How many times its last step's progress each remaining step of a trial may make."""
MOST_FREE = 20
"""At most 4 vertices of 2 coordinates, their 4 + 4 edges' bulges, and some room."""
ROUNDING = 1e-13
"""Squared error per pixel of a window that a rewrite must gain besides its cost: less is not told from rounding."""


@nb.njit(cache=True)
def _stretch_edge(box: Floats, x: Floats, y: Floats, b: Floats, nxt: Ints, e: int) -> None:
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
def solve(matrix: Floats, gradient: Floats, damping: float, step: Floats) -> bool:
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
def _stretch_site(box: Floats, loops: Linked, rule: int, site: int, other: int, vertices: Ints) -> None:
    """Grow a box to hold the edges that a rewrite changes, before it is applied."""
    x, y, b, _, nxt, prv = loops
    if rule == Rule.REMOVE_LOOP or rule == Rule.CIRCLE:
        i = site
        while True:
            _stretch_edge(box, x, y, b, nxt, i)
            i = nxt[i]
            if i == site:
                break
    for v in vertices:
        if v < x.shape[0]:
            _stretch_edge(box, x, y, b, nxt, v)
            _stretch_edge(box, x, y, b, nxt, prv[v])
    if rule != Rule.ADD_LOOP and rule != Rule.CIRCLE:
        _stretch_edge(box, x, y, b, nxt, site)
    if rule == Rule.CLOSE:
        _stretch_edge(box, x, y, b, nxt, nxt[site])
    if rule == Rule.PINCH:
        for e in (other, nxt[site], nxt[other], prv[site], prv[other]):
            _stretch_edge(box, x, y, b, nxt, e)


@nb.njit(cache=True)
def _parameters(loops: Linked, vertices: Ints, own: Ints, columns: Ints, bulges: Ints) -> int:
    """Number the parameters of a trial: x, y of ``vertices``, then the bulges of the arcs among the edges ``own`` and
    beside the vertices. Fills ``columns`` (n, NUMBERS) and, from there on, ``bulges`` with the arcs; returns how many
    parameters there are."""
    arc, prv = loops.arc, loops.prv
    size: int = 2 * vertices.shape[0]
    for k in range(vertices.shape[0]):
        v, p = vertices[k], prv[vertices[k]]
        columns[v, 0], columns[v, 1] = 2 * k, 2 * k + 1
        columns[p, 2], columns[p, 3] = 2 * k, 2 * k + 1
    for k in range(own.shape[0] + 2 * vertices.shape[0]):
        beside = k - own.shape[0]
        e = own[k] if beside < 0 else vertices[beside // 2]
        if beside >= 0 and beside % 2 == 1:
            e = prv[e]
        if arc[e] and columns[e, 4] < 0:
            columns[e, 4] = size
            bulges[size] = e
            size += 1
    return size


@nb.njit(cache=True)
def _put(values: Floats, vertices: Ints, bulges: Ints, loops: Linked) -> None:
    """Set a trial's parameters in its loops."""
    for k in range(vertices.shape[0]):
        loops.x[vertices[k]], loops.y[vertices[k]] = values[2 * k], values[2 * k + 1]
    for k in range(2 * vertices.shape[0], values.shape[0]):
        loops.b[bulges[k]] = values[k]


@nb.njit(cache=True)
def _descend(
    scene: Scene,
    loops: Linked,
    columns: Ints,
    vertices: Ints,
    bulges: Ints,
    picture: Picture,
    ramp: float,
    steps: int,
    goal: float,
    values: Floats,
) -> float:
    """Levenberg-Marquardt on the parameters ``values`` (size,), left at their best; returns their squared error.

    Ends early when a step's progress leaves no hope of getting under ``goal`` by the remaining ones.
    """
    band, error = render(scene, loops, picture, ramp)
    size = values.shape[0]
    edges = scene.moving.shape[0]
    own_columns = np.empty((edges, NUMBERS), np.int64)
    for i in range(edges):
        own_columns[i] = columns[scene.moving[i]]
    matrix, gradient = np.empty((size, size)), np.empty(size)
    step, tried = np.empty(size), np.empty(size)
    damping = 1e-3
    fresh = True
    for taken in range(steps if size > 0 else 0):
        if fresh:
            matrix[:] = 0.0
            gradient[:] = 0.0
            slope = slopes(scene.table, band, ramp, 1.0, edges)
            add_normal_equations(
                picture.target, band.row, band.col, band.cover, band.edge, slope, own_columns, gradient, matrix,
                picture.slack,
            )  # fmt: skip
        if not solve(matrix, gradient, damping, step):
            break
        longest = 0.0
        for k in range(2 * vertices.shape[0]):
            longest = max(longest, abs(step[k]))
        cut = min(1.0, REACH / longest) if longest > 0.0 else 1.0
        for k in range(size):
            tried[k] = values[k] + cut * step[k]
        _put(tried, vertices, bulges, loops)
        new_band, new = render(scene, loops, picture, ramp)
        fresh = new < error
        if fresh:
            if taken > 0 and new - HOPE * (steps - taken) * (error - new) > goal:
                return float(new)
            values[:] = tried
            error, band = new, new_band
            damping = max(0.1 * damping, 1e-9)
        else:
            damping *= 10.0
    return float(error)


@nb.njit(cache=True)
def _trial(
    rule: int,
    site: int,
    data: Floats,
    cost: float,
    base: Base,
    room: Linked,
    picture: Picture,
    ramp: float,
    steps: int,
    fit: Floats,
) -> tuple[float, int]:
    """Gain of one rewrite, the decrease of the squared error less ``cost``, and the number of vertices that it tunes;
    puts its parameters in ``fit`` (MOST_FREE,).

    Ends early, with a loss, when even no error at all in the window would not pay for it. room: Linked with
    NEW_VERTICES more than the base, overwritten.
    """
    height, width = picture.target.shape
    n = base.loops.x.shape[0]
    x, y, b, arc, nxt, prv = room
    x[:n], y[:n], b[:n] = base.loops.x, base.loops.y, base.loops.b
    arc[:n], nxt[:n], prv[:n] = base.loops.arc, base.loops.nxt, base.loops.prv
    for k in range(n, n + NEW_VERTICES):
        x[k], y[k], b[k], arc[k], nxt[k], prv[k] = -1e7, -1e7, 0.0, False, k, k
    vertices = np.empty(4, np.int64)
    own = np.empty(4, np.int64)
    free, own_count = touched(rule, site, data, nxt, prv, n, vertices, own)
    vertices, own = vertices[:free], own[:own_count]

    box = np.array((np.inf, np.inf, -np.inf, -np.inf))
    _stretch_site(box, base.loops, rule, site, int(data[0]), vertices)
    rewrite(rule, site, data, x, y, b, arc, nxt, prv, n)
    for e in vertices:
        _stretch_edge(box, x, y, b, nxt, e)
    for e in own:
        _stretch_edge(box, x, y, b, nxt, e)
    pad = MARGIN + ramp
    c0, r0 = max(math.floor(max(box[0], 0.0) - pad), 0), max(math.floor(max(box[1], 0.0) - pad), 0)
    c1 = min(math.ceil(min(box[2], float(width)) + pad), width)
    r1 = min(math.ceil(min(box[3], float(height)) + pad), height)
    if r1 <= r0 or c1 <= c0:
        return -1.0, free

    goal = base_error(base, picture, r0, r1, c0, c1) - cost - ROUNDING * (r1 - r0) * (c1 - c0)
    if goal <= 0.0:
        return goal, free
    columns = np.full((n + NEW_VERTICES, NUMBERS), -1)
    bulges = np.empty(MOST_FREE, np.int64)
    size = _parameters(room, vertices, own, columns, bulges)
    scene = scene_of(room, base, moving_edges(room, base, columns), picture, r0, r1, c0, c1, ramp)
    values = fit[:size]
    for k in range(size):
        values[k] = b[bulges[k]] if k >= 2 * free else (x[vertices[k // 2]] if k % 2 == 0 else y[vertices[k // 2]])
    return goal - _descend(scene, room, columns, vertices, bulges, picture, ramp, steps, goal, values), free


@nb.njit(cache=True)
def trials(
    rules: Ints, sites: Ints, data: Floats, costs: Floats, loops: Linked, picture: Picture, ramp: float, steps: int
) -> tuple[Floats, Ints, Floats]:
    """Try rewrites one by one on the same base.

    rules, sites: (k,) int64; data: (k, 3); costs: (k,) the squared error each must earn; loops: the base in
    pixels. Returns gain (k,), the decrease of the squared error less the cost, free (k,), the number of tuned vertices,
    and fit (k, MOST_FREE): x, y of those vertices, then the bulges of the own arcs.
    """
    count, more = rules.shape[0], loops.x.shape[0] + NEW_VERTICES
    gain = np.empty(count)
    free = np.empty(count, np.int64)
    fit = np.zeros((count, MOST_FREE))
    base = base_of(loops, picture.target.shape, ramp)
    room = Linked(
        np.empty(more), np.empty(more), np.empty(more),
        np.empty(more, np.bool_), np.empty(more, np.int64), np.empty(more, np.int64),
    )  # fmt: skip
    for k in range(count):
        gain[k], free[k] = _trial(rules[k], sites[k], data[k], costs[k], base, room, picture, ramp, steps, fit[k])
    return gain, free, fit
