"""Row kernel: leaves to the band of pixels near the boundary of their union. Everything here is in pixels.

Of the union only the least distance counts. The part of a row where one leaf's distance is under a level is a single
run (`leaves.run`), so the inside of the union is a merge of sorted runs, and only pixels between a leaf's outermost
and innermost run, and in no leaf's innermost one, are ever measured: the cost grows with the leaves' outlines.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from d4cad.grammars.tree.kinematics import HEADING, SIZE, X, Y
from d4cad.grammars.tree.leaves import distance, run, slope
from d4cad.program import Floats
from d4cad.raster.band import NUMBERS

Ints = NDArray[np.int64]


@nb.njit(cache=True, inline="always", error_model="numpy")
def _first_column(x: float) -> int:
    """The first column whose centre is at x or right of it."""
    return math.ceil(x - 0.5)


@nb.njit(cache=True, error_model="numpy")
def reach_of(r: float, excess: float, level: float) -> float:
    """How far from its widest place a leaf's distance can be at most ``level``."""
    e = excess * r
    return math.sqrt(max((r + e + level) ** 2 - e * e, 0.0))


@nb.njit(cache=True, error_model="numpy")
def columns_of(
    pose: Floats, i: int, row: int, excess: float, offset: float, level: float, c0: int, c1: int
) -> tuple[int, int]:
    """First and past-the-last column in [c0, c1) where leaf i's distance is at most ``level`` in a row of pixels."""
    cos, sin = math.cos(pose[i, HEADING]), math.sin(pose[i, HEADING])
    low, high = run(pose[i, X], pose[i, Y] - row - 0.5, cos, sin, pose[i, SIZE], excess, offset, level)
    if low > high:
        return c0, c0
    a = min(max(_first_column(low), c0), c1)
    b = min(max(math.floor(high - 0.5) + 1, c0), c1)
    return (a, b) if a < b else (c0, c0)


@nb.njit(cache=True)
def _merge(start: Ints, stop: Ints, count: int) -> int:
    """Sort and join the first ``count`` runs in place; returns how many are left. Runs that touch are one."""
    for k in range(1, count):
        a, b = start[k], stop[k]
        at = k
        while at > 0 and start[at - 1] > a:
            start[at], stop[at] = start[at - 1], stop[at - 1]
            at -= 1
        start[at], stop[at] = a, b
    kept = 0
    for k in range(count):
        if start[k] >= stop[k]:
            continue
        if kept > 0 and start[k] <= stop[kept - 1]:
            stop[kept - 1] = max(stop[kept - 1], stop[k])
        else:
            start[kept], stop[kept] = start[k], stop[k]
            kept += 1
    return kept


@nb.njit(cache=True, error_model="numpy")
def scan(
    pose: Floats, excess: float, offset: float, r0: int, r1: int, c0: int, c1: int, ramp: float
) -> tuple[Any, ...]:
    """The band of a union of leaves in the rows [r0, r1) and columns [c0, c1).

    pose: (n, 4) x, y, heading, size; excess, offset: of the leaf's shape; ramp: half-width of the ramp.

    Returns (row, col, cover, wound, piece, spans): row, col (m,) int32: the pixels nearer than ``ramp`` to the
    boundary; cover (m,): their coverage 1/2 - d / (2 ramp); wound (m,) uint8: 1 inside; piece (m,) int32: the leaf
    of the least distance; spans (k, 3) int64: row, first and past-the-last column of runs of inside pixels.
    """
    n = pose.shape[0]
    rows = max(r1 - r0, 0)
    low_row = np.empty(n, np.int64)
    high_row = np.empty(n, np.int64)
    first = np.zeros(rows + 2, np.int64)
    for i in range(n):
        away = reach_of(pose[i, SIZE], excess, ramp)
        middle = pose[i, Y] + offset * pose[i, SIZE] * math.sin(pose[i, HEADING])
        low_row[i] = min(max(_first_column(middle - away), r0), r1)
        high_row[i] = min(max(math.floor(middle + away - 0.5) + 1, low_row[i]), r1)
        if high_row[i] > low_row[i]:
            first[low_row[i] - r0 + 1] += 1
            first[high_row[i] - r0 + 1] -= 1
    for _ in range(2):  # differences of counts to counts to first positions
        for r in range(rows):
            first[r + 1] += first[r]
    total = first[rows]
    leaf = np.empty(total, np.int64)
    outer = np.empty((total, 2), np.int64)
    inner = np.empty((total, 2), np.int64)
    half = np.empty((total, 2), np.int64)
    fill = first[:rows].copy()
    capacity = 0
    for i in range(n):
        for r in range(low_row[i], high_row[i]):
            at = fill[r - r0]
            fill[r - r0] += 1
            leaf[at] = i
            outer[at] = columns_of(pose, i, r, excess, offset, ramp, c0, c1)
            if outer[at, 0] == outer[at, 1]:
                half[at] = c0, c0
                inner[at] = c0, c0
                continue
            half[at] = columns_of(pose, i, r, excess, offset, 0.0, c0, c1)
            inner[at] = columns_of(pose, i, r, excess, offset, -ramp, c0, c1)
            capacity += outer[at, 1] - outer[at, 0] - (inner[at, 1] - inner[at, 0])

    capacity = min(capacity, rows * max(c1 - c0, 0))
    row_of = np.empty(capacity, np.int32)
    col_of = np.empty(capacity, np.int32)
    cover = np.empty(capacity)
    wound = np.empty(capacity, np.uint8)
    piece = np.empty(capacity, np.int32)
    spans = np.empty((total, 3), np.int64)
    most = 0
    for r in range(rows):
        most = max(most, first[r + 1] - first[r])
    start, stop = np.empty(most, np.int64), np.empty(most, np.int64)
    from_, to = np.empty(most, np.int64), np.empty(most, np.int64)
    slot = np.full(max(c1 - c0, 0), -1, np.int32)
    cos, sin = np.cos(pose[:, HEADING]), np.sin(pose[:, HEADING])
    m = 0
    span_count = 0
    for r in range(r0, r1):
        begin, a, b = m, first[r - r0], first[r - r0 + 1]
        for k in range(b - a):
            start[k], stop[k] = inner[a + k]
            from_[k], to[k] = half[a + k]
        deep = _merge(start, stop, b - a)
        runs = _merge(from_, to, b - a)
        for k in range(runs):
            spans[span_count, 0], spans[span_count, 1], spans[span_count, 2] = r, from_[k], to[k]
            span_count += 1
        for at in range(a, b):
            i = leaf[at]
            dy = r + 0.5 - pose[i, Y]
            col = outer[at, 0]
            k = 0
            while col < outer[at, 1]:
                while k < deep and stop[k] <= col:
                    k += 1
                if k < deep and start[k] <= col:
                    col = stop[k]
                    continue
                d = distance(col + 0.5 - pose[i, X], dy, cos[i], sin[i], pose[i, SIZE], excess, offset)
                here = 0.5 - 0.5 * d / ramp
                s = slot[col - c0]
                if s < 0:
                    if here > 0.0:
                        slot[col - c0] = m
                        row_of[m], col_of[m], cover[m], piece[m] = r, col, here, i
                        m += 1
                elif here > cover[s]:
                    cover[s], piece[s] = here, i
                col += 1
        for s in range(begin, m):
            slot[col_of[s] - c0] = -1
            cover[s] = min(cover[s], 1.0)
            inside = 0
            for k in range(runs):
                if from_[k] <= col_of[s] < to[k]:
                    inside = 1
            wound[s] = inside
    return row_of[:m], col_of[:m], cover[:m], wound[:m], piece[:m], spans[:span_count]


@nb.njit(cache=True, error_model="numpy")
def slopes(
    pose: Floats,
    excess: float,
    offset: float,
    row: NDArray[np.int32],
    col: NDArray[np.int32],
    piece: NDArray[np.int32],
    ramp: float,
    unit: float,
) -> Floats:
    """Derivative (m, NUMBERS) of a band's coverage by x, y, heading and size of the leaf of each pixel.

    unit: pixels per unit of length in the derivative by x, y and size.
    """
    out = np.zeros((row.shape[0], NUMBERS))
    cos, sin = np.cos(pose[:, HEADING]), np.sin(pose[:, HEADING])
    for s in range(row.shape[0]):
        i = piece[s]
        dx, dy = col[s] + 0.5 - pose[i, X], row[s] + 0.5 - pose[i, Y]
        slope(dx, dy, cos[i], sin[i], pose[i, SIZE], excess, offset, out[s], -0.5 / ramp)
        out[s, 0] *= unit
        out[s, 1] *= unit
        out[s, 3] *= unit
    return out


@nb.njit(cache=True, error_model="numpy")
def layers(
    pose: Floats, excess: float, offset: float, height: int, width: int, ramp: float
) -> tuple[Floats, Floats, NDArray[np.int32]]:
    """Of every pixel the greatest coverage by a leaf, the second greatest by another one, and the first one's number
    (-1: none), (height, width) each."""
    best = np.zeros((height, width))
    second = np.zeros((height, width))
    owner = np.full((height, width), -1, np.int32)
    for i in range(pose.shape[0]):
        cos, sin = math.cos(pose[i, HEADING]), math.sin(pose[i, HEADING])
        away = reach_of(pose[i, SIZE], excess, ramp)
        middle = pose[i, Y] + offset * pose[i, SIZE] * sin
        for r in range(max(_first_column(middle - away), 0), min(math.floor(middle + away - 0.5) + 1, height)):
            a, b = columns_of(pose, i, r, excess, offset, ramp, 0, width)
            for c in range(a, b):
                d = distance(c + 0.5 - pose[i, X], r + 0.5 - pose[i, Y], cos, sin, pose[i, SIZE], excess, offset)
                here = min(max(0.5 - 0.5 * d / ramp, 0.0), 1.0)
                if here > best[r, c]:
                    second[r, c] = best[r, c]
                    best[r, c] = here
                    owner[r, c] = i
                elif here > second[r, c]:
                    second[r, c] = here
    return best, second, owner
