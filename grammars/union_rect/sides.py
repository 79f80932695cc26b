"""Sides of rectangles and the parts of them that other rectangles leave free, compiled. All in pixels.

A rectangle is (cx, cy, hx, hy, angle): centre, half-sizes, and the angle of its local x axis. Its sides are numbered
counter-clockwise, side k facing the local direction +x, +y, -x, -y; side k runs from corner k to corner k + 1.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TOUCH = 1e-7
"""Sides this near (px) to each other lie on each other."""
SHORT = 1e-6
"""Free parts of sides shorter than this (px) are rounding."""
ALIKE = 0.7
"""Sides face the same way if the cosine between their outward normals is larger."""

RECT, SIDE, CUT_START, CUT_END = range(4)
"""Columns of the free parts (m, 4): the rectangle, its side, and what ends the part at its start and at its end: side m
of rectangle j as 4 j + m. At a corner that is the rectangle's own neighbouring side."""
SX, SY, DX, DY, LENGTH = range(5)
"""Columns of their places (m, 5): start, unit direction, length."""


@nb.njit(cache=True, error_model="numpy")
def frames(rects: Floats) -> Floats:
    """Cosine and sine of each rectangle's angle and its circumscribed radius, (n, 3)."""
    found = np.empty((rects.shape[0], 3))
    for i in range(rects.shape[0]):
        found[i, 0], found[i, 1] = math.cos(rects[i, 4]), math.sin(rects[i, 4])
        found[i, 2] = math.hypot(rects[i, 2], rects[i, 3])
    return found


@nb.njit(cache=True, inline="always", error_model="numpy")
def normal(frame: Floats, i: int, k: int) -> tuple[float, float]:
    """Outward unit normal of side k of rectangle i."""
    c, s = frame[i, 0], frame[i, 1]
    if k == 0:
        return c, s
    if k == 1:
        return -s, c
    if k == 2:
        return -c, -s
    return s, -c


@nb.njit(cache=True, error_model="numpy")
def side(rects: Floats, frame: Floats, i: int, k: int) -> tuple[float, float, float, float, float]:
    """Start, unit direction and length of side k of rectangle i."""
    nx, ny = normal(frame, i, k)
    out, half = (rects[i, 2], rects[i, 3]) if k % 2 == 0 else (rects[i, 3], rects[i, 2])
    dx, dy = -ny, nx
    return rects[i, 0] + out * nx - half * dx, rects[i, 1] + out * ny - half * dy, dx, dy, 2.0 * half


@nb.njit(cache=True, error_model="numpy")
def _covered(
    rects: Floats,
    frame: Floats,
    i: int,
    k: int,
    place: tuple[float, float, float, float, float],
    j: int,
    alike: float,
    other: float,
) -> tuple[float, float, int, int]:
    """The part of side k of rectangle i that lies in rectangle j, from and to along the side, and the sides of j that
    bound it (-1: the side's own end). Empty where from >= to.

    Sides of j are moved outwards by ``alike`` where they face as side k does, else by ``other``.
    """
    px, py, dx, dy, length = place
    nx, ny = dy, -dx
    begin, end, first, last = 0.0, length, -1, -1
    px -= rects[j, 0]
    py -= rects[j, 1]
    for m in range(4):
        mx, my = normal(frame, j, m)
        slack = alike if nx * mx + ny * my > ALIKE else other
        room = (rects[j, 2] if m % 2 == 0 else rects[j, 3]) + slack - (px * mx + py * my)
        along = dx * mx + dy * my
        if abs(along) < 1e-13:
            if room < 0.0:
                return 1.0, 0.0, -1, -1
        elif along > 0.0:
            if room / along < end:
                end, last = room / along, m
        elif room / along > begin:
            begin, first = room / along, m
    return begin, end, first, last


@nb.njit(cache=True, error_model="numpy")
def free_parts(rects: Floats, frame: Floats, only: int, skip: int, outside: bool) -> tuple[Ints, Floats]:
    """The parts of sides that are not in other rectangles: of rectangle ``only``, or of all if it is -1. Rectangle
    ``skip`` counts for nothing.

    outside: True gives the boundary of the union: sides that lie on each other with both insides on one side are there
    once, sides that lie back to back are not there. False asks what is uncovered just inside the side: only other
    sides that face the same way hide it.

    Returns the parts (m, 4) and their places (m, 5).
    """
    n = rects.shape[0]
    parts = np.empty((4 * n * n + 4, 4), np.int64)
    places = np.empty((parts.shape[0], 5))
    count = 0
    start, stop = np.empty(n), np.empty(n)
    first, last = np.empty(n, np.int64), np.empty(n, np.int64)
    near = np.empty(n, np.int64)
    for i in range(n):
        if i == skip or (only >= 0 and i != only):
            continue
        others = 0
        for j in range(n):
            if j in (i, skip):
                continue
            reach = frame[i, 2] + frame[j, 2] + 1.0
            if (rects[i, 0] - rects[j, 0]) ** 2 + (rects[i, 1] - rects[j, 1]) ** 2 <= reach * reach:
                near[others] = j
                others += 1
        for k in range(4):
            place = side(rects, frame, i, k)
            covers = 0
            for at in range(others):
                j = near[at]
                if outside:
                    begin, end, low, high = _covered(rects, frame, i, k, place, j, TOUCH if j < i else -TOUCH, TOUCH)
                else:
                    begin, end, low, high = _covered(rects, frame, i, k, place, j, TOUCH, -TOUCH)
                if begin >= end:
                    continue
                # Sorted by where they begin.
                at_place = covers
                while at_place > 0 and start[at_place - 1] > begin:
                    start[at_place], stop[at_place] = start[at_place - 1], stop[at_place - 1]
                    first[at_place], last[at_place] = first[at_place - 1], last[at_place - 1]
                    at_place -= 1
                start[at_place], stop[at_place] = begin, end
                first[at_place], last[at_place] = 4 * j + low, 4 * j + high
                covers += 1
            free, by = 0.0, 4 * i + (k + 3) % 4
            for c in range(covers + 1):
                until = start[c] if c < covers else place[4]
                if until - free > SHORT or (until >= free and place[4] <= SHORT and covers == 0):
                    parts[count, 0], parts[count, 1] = i, k
                    parts[count, 2] = by
                    parts[count, 3] = first[c] if c < covers else 4 * i + (k + 1) % 4
                    places[count, 0] = place[0] + free * place[2]
                    places[count, 1] = place[1] + free * place[3]
                    places[count, 2], places[count, 3], places[count, 4] = place[2], place[3], until - free
                    count += 1
                if c < covers and stop[c] > free:
                    free, by = stop[c], last[c]
            # A cover that ends with the side itself leaves nothing free behind it.
    return parts[:count], places[:count]
