"""Trials of rewrites, compiled: the rectangles that a rewrite makes are fitted by a few Levenberg-Marquardt steps
inside the window that it can change, all others at rest. All in pixels."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from d4cad.grammars.arc_line.scene import Picture
from d4cad.grammars.arc_line.trials import solve
from d4cad.grammars.union_rect.raster import Rows, entries, scan, slopes
from d4cad.grammars.union_rect.sides import Floats, Ints
from d4cad.raster.band import add_normal_equations, squared_error

MARGIN = 8.0
"""Pixels that the window extends beyond the rectangles that go and come."""
REACH = 6.0
"""The furthest (px) that a side may move in one step."""
HOPE = 2.0
"""How many times its last step's progress each remaining step of a trial may make."""
THIN = 0.75
"""Half-sizes (px) under which a trial makes no rectangle."""
ROUNDING = 1e-13
"""Squared error per pixel that a rewrite must gain besides its cost: less is not told from rounding."""

Window = tuple[int, int, int, int]


@nb.njit(cache=True, error_model="numpy")
def _window(rects: Floats, pad: float, height: int, width: int) -> Window:
    """Rows and columns [r0, r1), [c0, c1) that hold rectangles and their ramp."""
    x0, y0, x1, y1 = np.inf, np.inf, -np.inf, -np.inf
    for k in range(rects.shape[0]):
        c, s = abs(math.cos(rects[k, 4])), abs(math.sin(rects[k, 4]))
        wide, tall = rects[k, 2] * c + rects[k, 3] * s, rects[k, 2] * s + rects[k, 3] * c
        x0, x1 = min(x0, rects[k, 0] - wide), max(x1, rects[k, 0] + wide)
        y0, y1 = min(y0, rects[k, 1] - tall), max(y1, rects[k, 1] + tall)
    r0, r1 = max(math.floor(max(y0 - pad, 0.0)), 0), min(math.ceil(min(y1 + pad, float(height))), height)
    c0, c1 = max(math.floor(max(x0 - pad, 0.0)), 0), min(math.ceil(min(x1 + pad, float(width))), width)
    return r0, r1, c0, c1


@nb.njit(cache=True, error_model="numpy")
def _seen(rects: Floats, window: Window, ramp: float) -> Floats:
    """The rectangles that can be seen in a window."""
    r0, r1, c0, c1 = window
    keep = np.zeros(rects.shape[0], np.bool_)
    for k in range(rects.shape[0]):
        c, s = abs(math.cos(rects[k, 4])), abs(math.sin(rects[k, 4]))
        wide, tall = rects[k, 2] * c + rects[k, 3] * s + ramp, rects[k, 2] * s + rects[k, 3] * c + ramp
        keep[k] = (
            rects[k, 0] - wide <= c1
            and rects[k, 0] + wide >= c0
            and rects[k, 1] - tall <= r1
            and rects[k, 1] + tall >= r0
        )
    return rects[keep]


@nb.njit(cache=True, error_model="numpy")
def _render(rects: Floats, window: Window, picture: Picture, empty: float, ramp: float) -> tuple[Rows, float]:
    """The band of rectangles in a window, and its squared error."""
    band = scan(rects, window[0], window[1], window[2], window[3], ramp)
    error = squared_error(picture.target, picture.runs, empty, band[0], band[1], band[2], band[3], band[6], 0.0)
    return band, error


@nb.njit(cache=True, error_model="numpy")
def _descend(
    rects: Floats, free: int, window: Window, picture: Picture, empty: float, ramp: float, steps: int, goal: float
) -> float:
    """Levenberg-Marquardt on the first ``free`` rectangles, left at their best; returns their squared error.

    Ends early when a step's progress leaves no hope of getting under ``goal`` by the remaining ones.
    """
    band, error = _render(rects, window, picture, empty, ramp)
    size = 5 * free
    columns = np.arange(size).reshape(free, 5)
    matrix, gradient, step = np.empty((size, size)), np.empty(size), np.empty(size)
    tried = rects.copy()
    damping = 1e-3
    fresh = True
    for taken in range(steps if free > 0 else 0):
        if fresh:
            matrix[:] = 0.0
            gradient[:] = 0.0
            rect, slope, twin, twin_rect, twin_slope = slopes(rects, band, ramp, 1.0, free)
            row, col, cover, _, owner, by = entries(band, rect, slope, twin, twin_rect, twin_slope)
            add_normal_equations(picture.target, row, col, cover, owner, by, columns, gradient, matrix, 0.0)
        if not solve(matrix, gradient, damping, step):
            break
        longest = 0.0
        for k in range(size):
            i = k // 5
            lever = math.hypot(rects[i, 2], rects[i, 3]) if k % 5 == 4 else 1.0
            longest = max(longest, abs(step[k]) * lever)
        cut = min(1.0, REACH / longest) if longest > 0.0 else 1.0
        for i in range(free):
            for k in range(5):
                tried[i, k] = rects[i, k] + cut * step[5 * i + k]
            tried[i, 2], tried[i, 3] = max(tried[i, 2], THIN), max(tried[i, 3], THIN)
        new_band, new = _render(tried, window, picture, empty, ramp)
        fresh = new < error
        if fresh:
            if taken > 0 and new - HOPE * (steps - taken) * (error - new) > goal:
                return float(new)
            rects[:free] = tried[:free]
            error, band = new, new_band
            damping = max(0.1 * damping, 1e-9)
        else:
            damping *= 10.0
    return float(error)


@nb.njit(cache=True, error_model="numpy")
def trial(
    rects: Floats, gone: Ints, new: Floats, cost: float, picture: Picture, ramp: float, steps: int
) -> tuple[float, Floats]:
    """What an exchange gains, the decrease of the squared error less ``cost``, and the fitted new rectangles (k, 5).

    rects: (n, 5) the base; gone: (g,) numbers of those that go; new: (k, 5) those that come, as first guesses.
    """
    height, width = picture.target.shape
    old = rects[gone]
    window = _window(np.concatenate((old, new)), MARGIN + ramp, height, width)
    r0, r1, c0, c1 = window
    if r1 <= r0 or c1 <= c0:
        return -1.0, new
    keep = np.ones(rects.shape[0], np.bool_)
    keep[gone] = False
    rest = _seen(rects[keep], window, ramp)
    empty = 0.0
    for r in range(r0, r1):
        empty += picture.squares[r, c1] - picture.squares[r, c0]
    _, before = _render(np.concatenate((old, rest)), window, picture, empty, ramp)
    goal = before - cost - ROUNDING * (r1 - r0) * (c1 - c0)
    if goal <= 0.0:
        return goal, new
    now = np.concatenate((new, rest))
    if now.shape[0] == 0:
        return -1.0, new
    error = _descend(now, new.shape[0], window, picture, empty, ramp, steps, goal)
    return goal - error, now[: new.shape[0]]
