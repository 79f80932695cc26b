"""Trials of new nodes, compiled: a chain is fitted by a few Levenberg-Marquardt steps on its own numbers, all else at
rest. Everything here is in pixels.

The coverage of a union is the greatest coverage of its leaves, so that a chain's leaves change the picture only where
they cover more than the base does, and only the pixels about them are visited.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from numpy.typing import NDArray

from d4cad.grammars.tree.kinematics import HEADING, SIZE, X, Y, assemble, chains, poses, pull_back, solve
from d4cad.grammars.tree.leaves import distance, slope
from d4cad.grammars.tree.raster import columns_of, reach_of
from d4cad.program import Floats
from d4cad.raster.band import NUMBERS

Ints = NDArray[np.int64]

STIFF = 1e12
"""Stiffness, as a multiple of the stiffest number's, of what must rest at its limit."""


@nb.njit(cache=True, error_model="numpy")
def _drawn(
    pose: Floats, excess: float, offset: float, ramp: float, height: int, width: int
) -> tuple[Floats, NDArray[np.int32], int, int]:
    """Coverage by the nodes but the root, and the one that covers most (-1: none), in the window about them; its first
    row and column."""
    low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
    for i in range(1, pose.shape[0]):
        away = reach_of(pose[i, SIZE], excess, ramp)
        x = pose[i, X] + offset * pose[i, SIZE] * math.cos(pose[i, HEADING])
        y = pose[i, Y] + offset * pose[i, SIZE] * math.sin(pose[i, HEADING])
        low_x, low_y = min(low_x, x - away), min(low_y, y - away)
        high_x, high_y = max(high_x, x + away), max(high_y, y + away)
    c0, c1 = max(math.floor(low_x), 0), min(math.ceil(high_x), width)
    r0, r1 = max(math.floor(low_y), 0), min(math.ceil(high_y), height)
    cover = np.zeros((max(r1 - r0, 0), max(c1 - c0, 0)))
    owner = np.full(cover.shape, -1, np.int32)
    for i in range(1, pose.shape[0]):
        cos, sin = math.cos(pose[i, HEADING]), math.sin(pose[i, HEADING])
        away = reach_of(pose[i, SIZE], excess, ramp)
        middle = pose[i, Y] + offset * pose[i, SIZE] * sin
        for r in range(max(math.floor(middle - away), r0), min(math.ceil(middle + away), r1)):
            a, b = columns_of(pose, i, r, excess, offset, ramp, c0, c1)
            for c in range(a, b):
                d = distance(c + 0.5 - pose[i, X], r + 0.5 - pose[i, Y], cos, sin, pose[i, SIZE], excess, offset)
                here = min(0.5 - 0.5 * d / ramp, 1.0)
                if here > cover[r - r0, c - c0]:
                    cover[r - r0, c - c0], owner[r - r0, c - c0] = here, i
    return cover, owner, r0, c0


@nb.njit(cache=True, error_model="numpy")
def _change(cover: Floats, r0: int, c0: int, base: Floats, target: Floats) -> float:
    """By how much the squared error changes where ``cover`` is more than the base's coverage."""
    total = 0.0
    for r in range(cover.shape[0]):
        for c in range(cover.shape[1]):
            old = base[r0 + r, c0 + c]
            if cover[r, c] > old:
                t = target[r0 + r, c0 + c]
                total += (cover[r, c] - old) * (cover[r, c] + old - 2.0 * t)
    return total


@nb.njit(cache=True, error_model="numpy")
def fit_chain(
    table: Floats,
    pose: Floats,
    most: Floats,
    sized: bool,
    base: Floats,
    target: Floats,
    excess: float,
    offset: float,
    ramp: float,
    steps: int,
) -> float:
    """Fit a chain in place and return the decrease of the squared error by it.

    table: (1 + k, 3) length, angle, size; row 0 is the node that the chain starts from, of pose (4,). most: (3,) the
    greatest length, angle and size. base, target: (height, width) coverage without the chain and wanted.
    """
    n = table.shape[0]
    height, width = target.shape
    parent = np.arange(n) - 1
    before, first = chains(parent)
    m = 3 * n - 2
    x0, y0, heading = pose[X], pose[Y], pose[HEADING]
    here = poses(parent, table, x0, y0, heading)
    cover, owner, r0, c0 = _drawn(here, excess, offset, ramp, height, width)
    value = _change(cover, r0, c0, base, target)
    damping = 1e-2
    force, block = np.zeros((n, 4)), np.zeros((n, NUMBERS, NUMBERS))
    out = np.zeros(4)
    gradient = np.zeros(m)
    rows = np.zeros(first[-1])
    fresh = True
    for _ in range(steps):
        if fresh:
            force[:] = 0.0
            block[:] = 0.0
            for r in range(cover.shape[0]):
                for c in range(cover.shape[1]):
                    i = owner[r, c]
                    if i < 0 or cover[r, c] <= base[r0 + r, c0 + c] or cover[r, c] >= 1.0:
                        continue
                    residual = cover[r, c] - target[r0 + r, c0 + c]
                    dx, dy = c0 + c + 0.5 - here[i, X], r0 + r + 0.5 - here[i, Y]
                    cos, sin = math.cos(here[i, HEADING]), math.sin(here[i, HEADING])
                    slope(dx, dy, cos, sin, here[i, SIZE], excess, offset, out, -0.5 / ramp)
                    for k in range(4):
                        force[i, k] += out[k] * residual
                        for j in range(k + 1):
                            block[i, k, j] += out[k] * out[j]
            gradient = pull_back(parent, here, force)
            rows = assemble(parent, here, block, before, first)
        shift = np.empty(m)
        right = -gradient
        resting = np.zeros(m, np.bool_)
        stiffest = 1e-9
        for v in range(m):
            stiffest = max(stiffest, rows[first[v]])
        for v in range(m):
            node, kind = (v + 2) // 3, (v + 2) % 3
            low = -most[1] if kind == 1 else 0.0
            shift[v] = damping * rows[first[v]] + 1e-9 * stiffest
            at_low = table[node, kind] <= low and gradient[v] > 0.0
            at_high = table[node, kind] >= most[kind] and gradient[v] < 0.0
            if node == 0 or at_low or at_high or (kind == 2 and not sized):
                shift[v] = STIFF * stiffest
                right[v] = 0.0
                resting[v] = True
        step, good = solve(rows, before, first, shift, right)
        if not good:
            break
        tried = table.copy()
        for v in range(1, m):
            node, kind = (v + 2) // 3, (v + 2) % 3
            if resting[v]:
                continue
            low = -most[1] if kind == 1 else 0.0
            tried[node, kind] = min(max(table[node, kind] + step[v], low), most[kind])
        there = poses(parent, tried, x0, y0, heading)
        new_cover, new_owner, new_r0, new_c0 = _drawn(there, excess, offset, ramp, height, width)
        new = _change(new_cover, new_r0, new_c0, base, target)
        fresh = new < value
        if fresh:
            settled = value - new < 1e-3 * abs(value)
            table[:] = tried
            value, here, cover, owner, r0, c0 = new, there, new_cover, new_owner, new_r0, new_c0
            damping = max(0.1 * damping, 1e-9)
            if settled:
                break
        else:
            damping *= 10.0
    return float(-value)


@nb.njit(cache=True, error_model="numpy")
def best_shoots(
    nodes: Ints,
    pose: Floats,
    starts: Floats,
    most: Floats,
    sized: bool,
    base: Floats,
    target: Floats,
    excess: float,
    offset: float,
    ramp: float,
    steps: int,
) -> tuple[Floats, Floats]:
    """For every node of ``nodes`` (k,) the best new child: its gain (k,) in squared error and its numbers (k, 3).

    starts: (s, 3) first guesses of length, angle and size, of which the best is fitted.
    """
    gain = np.zeros(nodes.shape[0])
    shoot = np.zeros((nodes.shape[0], 3))
    table = np.zeros((2, 3))
    for k in range(nodes.shape[0]):
        here = pose[nodes[k]]
        best, chosen = -np.inf, 0
        for s in range(starts.shape[0]):
            table[1] = starts[s]
            value = fit_chain(table, here, most, sized, base, target, excess, offset, ramp, 0)
            if value > best:
                best, chosen = value, s
        table[1] = starts[chosen]
        gain[k] = fit_chain(table, here, most, sized, base, target, excess, offset, ramp, steps)
        shoot[k] = table[1]
    return gain, shoot


@nb.njit(cache=True, error_model="numpy")
def losses(best: Floats, second: Floats, owner: NDArray[np.int32], target: Floats, count: int) -> Floats:
    """By how much the squared error grows (count,) if a leaf goes, from `raster.layers`."""
    out = np.zeros(count)
    for r in range(target.shape[0]):
        for c in range(target.shape[1]):
            i = owner[r, c]
            if i >= 0:
                a, b, t = best[r, c], second[r, c], target[r, c]
                out[i] += (b - a) * (b + a - 2.0 * t)
    return out
