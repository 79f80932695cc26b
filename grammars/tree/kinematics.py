"""Forward kinematics of a tree and what goes back through it, compiled.

A node's pose is its place and heading: heading_i = heading_parent + angle_i, place_i = place_parent + length_i
(cos heading_i, sin heading_i). A parameter of node j moves j and all that hangs on it as one rigid body, so its column
of the Jacobian is a planar twist (vx, vy, omega), the velocity of the body's point at the origin: (cos, sin, 0) of the
heading for the length, and for the angle the turn about the parent's place (px, py): (py, -px, 1). A force or a
Gauss-Newton block on a leaf's pose is moved to the origin once and summed down the tree, which makes J'f cost O(n) and
J'BJ, whose entries vanish but between a node and its ancestors, O(n depth): the composite rigid body method. Numbering
from root to leaves, L'L of such a matrix has its own pattern (Featherstone, "Rigid Body Dynamics Algorithms", 2008,
section 6.5), so that it is factored and solved within its own storage, O(n depth^2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray

from d4cad.canvas import Canvas
from d4cad.grammars.tree.structure import ROOT_HEADING, Structure, table_of
from d4cad.program import Floats, Program

Ints = NDArray[np.int64]

X, Y, HEADING, SIZE = range(4)
"""Columns of poses."""


@nb.njit(cache=True)
def poses(parent: Ints, table: Floats, root_x: float, root_y: float, root_heading: float) -> Floats:
    """Place, heading and leaf size of every node, (n, 4); table: (n, 3) length, angle, size."""
    n = parent.shape[0]
    out = np.empty((n, 4))
    out[0] = root_x, root_y, root_heading, table[0, 2]
    for i in range(1, n):
        p = parent[i]
        heading = out[p, HEADING] + table[i, 1]
        out[i, X] = out[p, X] + table[i, 0] * math.cos(heading)
        out[i, Y] = out[p, Y] + table[i, 0] * math.sin(heading)
        out[i, HEADING] = heading
        out[i, SIZE] = table[i, 2]
    return out


def poses_of(program: Program[Structure]) -> Floats:
    """Place, heading and leaf size of every node in world units, (n, 4)."""
    x, y = program.structure.root
    return np.asarray(poses(program.structure.parent, table_of(program), x, y, ROOT_HEADING))


def on_canvas(pose: Floats, canvas: Canvas) -> Floats:
    """Poses in the canvas' pixels."""
    scaled = pose * np.array([1 / canvas.pixel, 1 / canvas.pixel, 1.0, 1 / canvas.pixel])
    scaled[:, :2] += np.array([canvas.width / 2, canvas.height / 2])
    return np.asarray(scaled)


@nb.njit(cache=True)
def pull_back(parent: Ints, pose: Floats, force: Floats) -> Floats:
    """J'f for a derivative ``force`` (n, 4) by the poses: the derivative by the parameters, (1 + 3 (n - 1),)."""
    n = parent.shape[0]
    total = np.zeros((n, 3))
    out = np.empty(3 * n - 2)
    for i in range(n - 1, -1, -1):
        total[i, 0] += force[i, X]
        total[i, 1] += force[i, Y]
        total[i, 2] += force[i, HEADING] + pose[i, X] * force[i, Y] - pose[i, Y] * force[i, X]
        out[3 * i] = force[i, SIZE]
        if i > 0:
            p = parent[i]
            cos, sin = math.cos(pose[i, HEADING]), math.sin(pose[i, HEADING])
            out[3 * i - 2] = cos * total[i, 0] + sin * total[i, 1]
            out[3 * i - 1] = pose[p, Y] * total[i, 0] - pose[p, X] * total[i, 1] + total[i, 2]
            for k in range(3):
                total[p, k] += total[i, k]
    return out


@nb.njit(cache=True)
def chains(parent: Ints) -> tuple[Ints, Ints]:
    """before (m,): the parameter above each one, -1 for none; first (m + 1,): where each one's row starts, which has
    itself and all those above it, from the nearest up.

    Above the length of a node is its parent's angle, above the angle the length, above the size the angle.
    """
    m = 3 * parent.shape[0] - 2
    before = np.full(m, -1)
    first = np.zeros(m + 1, np.int64)
    for v in range(m):
        node = (v + 2) // 3
        if node > 0:
            kind = (v + 2) % 3
            before[v] = v - 1 if kind > 0 else (3 * parent[node] - 1 if parent[node] > 0 else -1)
        above = first[before[v] + 1] - first[before[v]] if before[v] >= 0 else 0
        first[v + 1] = first[v] + above + 1
    return before, first


@nb.njit(cache=True)
def assemble(parent: Ints, pose: Floats, block: Floats, before: Ints, first: Ints) -> Floats:
    """The rows of J'BJ for symmetric blocks (n, >= 4, >= 4) on the poses, of which the lower half counts."""
    n = parent.shape[0]
    body = np.zeros((n, 6))  # xx, yx, yy, wx, wy, ww
    rows = np.empty(first[-1])
    twist = np.empty((3 * n - 2, 3))
    for i in range(1, n):
        p = parent[i]
        twist[3 * i - 2] = math.cos(pose[i, HEADING]), math.sin(pose[i, HEADING]), 0.0
        twist[3 * i - 1] = pose[p, Y], -pose[p, X], 1.0
    f = np.empty(3)
    for i in range(n - 1, -1, -1):
        b = block[i]
        x, y = pose[i, X], pose[i, Y]
        xx, yx, yy = b[0, 0], b[1, 0], b[1, 1]
        wx = b[2, 0] + x * yx - y * xx
        wy = b[2, 1] + x * yy - y * yx
        ww = b[2, 2] + x * (b[2, 1] + wy) - y * (b[2, 0] + wx)
        mine = body[i]
        mine[0] += xx
        mine[1] += yx
        mine[2] += yy
        mine[3] += wx
        mine[4] += wy
        mine[5] += ww
        size = 3 * i
        rows[first[size]] = b[3, 3]
        f[0], f[1], f[2] = b[3, 0], b[3, 1], b[3, 2] + x * b[3, 1] - y * b[3, 0]
        at, a = first[size] + 1, before[size]
        while a >= 0:
            rows[at] = twist[a, 0] * f[0] + twist[a, 1] * f[1] + twist[a, 2] * f[2]
            at += 1
            a = before[a]
        if i == 0:
            continue
        for v in range(3 * i - 2, 3 * i):
            tx, ty, tw = twist[v]
            f[0] = mine[0] * tx + mine[1] * ty + mine[3] * tw
            f[1] = mine[1] * tx + mine[2] * ty + mine[4] * tw
            f[2] = mine[3] * tx + mine[4] * ty + mine[5] * tw
            at, a = first[v], v
            while a >= 0:
                rows[at] = twist[a, 0] * f[0] + twist[a, 1] * f[1] + twist[a, 2] * f[2]
                at += 1
                a = before[a]
        for k in range(6):
            body[parent[i], k] += mine[k]
    return rows


@nb.njit(cache=True)
def solve(rows: Floats, before: Ints, first: Ints, shift: Floats, right: Floats) -> tuple[Floats, bool]:
    """x with (H + diag(shift)) x = right for the matrix of ``rows``; False where that is not positive definite."""
    m = before.shape[0]
    low = rows.copy()
    x = right.copy()
    for k in range(m - 1, -1, -1):
        start, length = first[k], first[k + 1] - first[k]
        pivot = low[start] + shift[k]
        if not pivot > 0.0:
            return x, False
        pivot = math.sqrt(pivot)
        low[start] = pivot
        inverse = 1.0 / pivot
        x[k] *= inverse
        for s in range(1, length):
            low[start + s] *= inverse
        i = before[k]
        for s in range(1, length):
            value = low[start + s]
            x[i] -= value * x[k]
            at = first[i] - s
            for q in range(s, length):
                low[at + q] -= value * low[start + q]
            i = before[i]
    for k in range(m):
        start = first[k]
        total = x[k]
        i = before[k]
        for s in range(1, first[k + 1] - start):
            total -= low[start + s] * x[i]
            i = before[i]
        x[k] = total / low[start]
    return x, True


@nb.njit(cache=True)
def _dense(rows: Floats, before: Ints, first: Ints) -> Floats:
    m = before.shape[0]
    out = np.zeros((m, m))
    for v in range(m):
        a, at = v, first[v]
        while a >= 0:
            out[v, a] = out[a, v] = rows[at]
            at += 1
            a = before[a]
    return out


@dataclass(frozen=True, slots=True, eq=False)
class TreeMatrix:
    """A symmetric matrix over a tree's parameters whose entries vanish but between a node and its ancestors.

    before, first: as :func:`chains` gives them; rows: as :func:`assemble` does.
    """

    before: Ints
    first: Ints
    rows: Floats

    def __mul__(self, factor: float) -> TreeMatrix:
        return TreeMatrix(self.before, self.first, self.rows * factor)

    def diagonal(self) -> Floats:
        """The diagonal (m,)."""
        return self.rows[self.first[:-1]]

    def solve(self, shift: Floats, right: Floats) -> Floats | None:
        """x with (H + diag(shift)) x = right, or None where that is not positive definite."""
        x, positive = solve(self.rows, self.before, self.first, shift, right)
        return x if positive else None

    def dense(self) -> Floats:
        """The matrix as an array (m, m)."""
        return np.asarray(_dense(self.rows, self.before, self.first))


@dataclass(frozen=True, slots=True, eq=False)
class Kinematics:
    """The chain from a tree's parameters to its leaves' poses: a `d4cad.raster.band.Chain`."""

    parent: Ints
    pose: Floats

    def pull_back(self, gradient: Floats) -> Floats:
        """The derivative by the parameters of what has the derivative (4 n,) by the poses."""
        return np.asarray(pull_back(self.parent, self.pose, gradient.reshape(-1, 4)))

    def curvature(self, blocks: Floats) -> TreeMatrix:
        """J'BJ for one block (n, NUMBERS, NUMBERS) for each leaf, of which the lower half is given."""
        before, first = chains(self.parent)
        return TreeMatrix(before, first, assemble(self.parent, self.pose, blocks, before, first))
