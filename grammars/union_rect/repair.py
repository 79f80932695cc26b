"""Repair: rectangles covered by the others go, partly covered ones shrink; the union stays as it is. Compiled, in
pixels."""

from __future__ import annotations

import numba as nb
import numpy as np

from d4cad.grammars.union_rect.sides import Floats, Ints, frames, free_parts

CLOSE = 1e-5
"""A rectangle shrinks only if that moves a side by more than this (px)."""


@nb.njit(cache=True, error_model="numpy")
def uncovered(rects: Floats, i: int, bounds: Floats) -> bool:
    """Whether any of rectangle i is outside the union of the others; its bounds u0, v0, u1, v1 in the rectangle's own
    frame, (4,).

    What is uncovered is bounded by parts of the rectangle's sides and by parts of the others' union inside it.
    """
    frame = frames(rects)
    bounds[:2], bounds[2:] = np.inf, -np.inf
    cos, sin = frame[i, 0], frame[i, 1]
    found = False
    for kind in range(2):
        if kind == 0:
            parts, places = free_parts(rects, frame, i, -1, False)
        else:
            parts, places = free_parts(rects, frame, -1, i, True)
        for k in range(parts.shape[0]):
            x0, y0 = places[k, 0] - rects[i, 0], places[k, 1] - rects[i, 1]
            u, v = x0 * cos + y0 * sin, y0 * cos - x0 * sin
            du = places[k, 2] * cos + places[k, 3] * sin
            dv = places[k, 3] * cos - places[k, 2] * sin
            begin, end = 0.0, places[k, 4]
            if kind == 1:
                # Inside by more than rounding, or a neighbour's side along the rectangle's own would count.
                begin, end = _within(u, du, rects[i, 2] - CLOSE, begin, end)
                begin, end = _within(v, dv, rects[i, 3] - CLOSE, begin, end)
            if end - begin <= CLOSE:
                continue
            found = True
            for s in (begin, end):
                bounds[0], bounds[2] = min(bounds[0], u + s * du), max(bounds[2], u + s * du)
                bounds[1], bounds[3] = min(bounds[1], v + s * dv), max(bounds[3], v + s * dv)
    return found


@nb.njit(cache=True, error_model="numpy")
def _within(at: float, slope: float, half: float, begin: float, end: float) -> tuple[float, float]:
    """The part of [begin, end] in which at + s slope lies in [-half, half]."""
    if abs(slope) < 1e-13:
        return (begin, end) if abs(at) <= half else (1.0, 0.0)
    a, b = (-half - at) / slope, (half - at) / slope
    return max(begin, min(a, b)), min(end, max(a, b))


@nb.njit(cache=True, error_model="numpy")
def repair(rects: Floats, least: float, lap: float) -> tuple[Floats, Ints, bool]:
    """Rectangles with the same union: none covered by the others, none longer than its uncovered part and ``lap``.

    least: rectangles with a half-size under this are dropped first, if any other remains; shrinking stops there.

    Returns (rects, origin, changed): the rectangles, the number of the given one that each continues, and whether
    anything is different.
    """
    n = rects.shape[0]
    order = np.argsort(rects[:, 2] * rects[:, 3], kind="mergesort")
    alive = np.ones(n, np.bool_)
    now = rects.copy()
    changed = False
    thick = (rects[:, 2] >= least) & (rects[:, 3] >= least)
    if thick.any() and not thick.all():
        alive = thick
        changed = True
    bounds = np.empty(4)
    for i in order:
        if not alive[i] or alive.sum() < 2:
            continue
        kept = np.flatnonzero(alive)
        place = int(np.searchsorted(kept, i))
        if not uncovered(now[kept], place, bounds):
            alive[i] = False
            changed = True
            continue
        moved = False
        for axis in range(2):
            half = now[i, 2 + axis]
            low, high = max(bounds[axis] - lap, -half), min(bounds[2 + axis] + lap, half)
            short = 2.0 * least - (high - low)
            if short > 0.0:
                low, high = max(low - short, -half), min(high + short, half)
            if low > -half + CLOSE or high < half - CLOSE:
                bounds[axis], bounds[2 + axis] = low, high
                moved = True
            else:
                bounds[axis], bounds[2 + axis] = -half, half
        if moved:
            u, v = 0.5 * (bounds[0] + bounds[2]), 0.5 * (bounds[1] + bounds[3])
            cos, sin = np.cos(now[i, 4]), np.sin(now[i, 4])
            now[i, 0] += u * cos - v * sin
            now[i, 1] += u * sin + v * cos
            now[i, 2], now[i, 3] = 0.5 * (bounds[2] - bounds[0]), 0.5 * (bounds[3] - bounds[1])
            changed = True
    kept = np.flatnonzero(alive)
    return now[kept], kept, changed
