"""The rewrites of the Tree grammar, each a function on nodes that keep their identity while several are applied.

A rewrite whose guard no longer holds where it is applied, because of others applied before it, does nothing and says so
by returning False.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import atan2, cos, hypot, inf, pi, sin

import numpy as np
from numpy.typing import NDArray

from d4cad.grammars.tree.structure import PER_NODE, Limits, Structure, program_of, table_of
from d4cad.program import Edit, Floats, Program, Rewrite

Shoot = tuple[float, float, float]
"""Length, angle and leaf size of a new node."""

SLACK = 1e-12
"""By how much rounding may put a length or an angle beyond its limit."""
MOST_CHILDREN = 2
LEAST_NODES = 3
"""Nodes besides the root that a tree must have for one of them to be removed."""


@dataclass(slots=True)
class Nodes:
    """A tree on its way from one program to another. parent, row, origin, alive: of every node that there ever was;
    a row is length, angle and size, an origin the old node or -1. ``origin`` of nodes on their old place is kept."""

    structure: Structure
    parent: list[int]
    row: list[list[float]]
    origin: list[int]
    alive: list[bool]
    children: list[list[int]] = field(default_factory=list)

    @classmethod
    def of(cls, program: Program[Structure]) -> Nodes:
        """All nodes of a program by their numbers."""
        structure = program.structure
        n = len(structure.parents)
        nodes = cls(structure, list(structure.parents), table_of(program).tolist(), list(range(n)), [True] * n)
        nodes.children = [[] for _ in range(n)]
        for node, parent in enumerate(structure.parents[1:], 1):
            nodes.children[parent].append(node)
        return nodes

    @property
    def limits(self) -> Limits:
        """Of the structure."""
        return self.structure.limits

    @property
    def count(self) -> int:
        """Number of nodes besides the root."""
        return sum(self.alive) - 1

    def add(self, parent: int, shoot: Shoot) -> int:
        """A new last child; returns its number."""
        node = len(self.parent)
        self.parent.append(parent)
        self.row.append(list(shoot))
        self.origin.append(-1)
        self.alive.append(True)
        self.children.append([])
        self.children[parent].append(node)
        return node

    def within(self, length: float, angle: float) -> bool:
        """Whether a branch keeps to the limits."""
        return length <= self.limits.length + SLACK and abs(angle) <= self.limits.angle + SLACK

    def edit(self) -> Edit[Structure]:
        """The program of what is alive, numbered from the root depth first, and where its parameters came from."""
        order, stack = [], [0]
        while stack:
            node = stack.pop()
            order.append(node)
            stack += reversed(self.children[node])
        number = {node: k for k, node in enumerate(order)}
        parents = tuple(-1 if node == 0 else number[self.parent[node]] for node in order)
        structure = replace(self.structure, parents=parents)
        program = program_of(structure, np.array([self.row[node] for node in order]))
        old = np.array([self.origin[node] for node in order])[:, None]
        origin = np.where(old >= 0, PER_NODE * old + np.arange(PER_NODE) - 2, -1)
        return Edit(program, origin.ravel()[2:].astype(np.int64))


def add_chain(nodes: Nodes, parent: int, shoots: list[Shoot]) -> bool:
    """New nodes one after another, the first on a node that has fewer than two children (SPEC 5.4)."""
    if not nodes.alive[parent] or len(nodes.children[parent]) >= MOST_CHILDREN:
        return False
    for shoot in shoots:
        parent = nodes.add(parent, shoot)
    return True


def split(nodes: Nodes, node: int, share: float, size: float | None = None) -> bool:
    """A new node on a branch, at ``share`` of it from the parent; the rest goes straight on (SPEC 5.2).

    size: of the new leaf, None for the mean of those at the branch's ends.
    """
    parent = nodes.parent[node]
    if not nodes.alive[node] or parent < 0:
        return False
    length, angle, mine = nodes.row[node]
    middle = nodes.add(parent, (share * length, angle, (nodes.row[parent][2] + mine) / 2 if size is None else size))
    siblings = nodes.children[parent]
    siblings.remove(middle)
    siblings[siblings.index(node)] = middle
    nodes.children[middle] = [node]
    nodes.parent[node] = middle
    nodes.row[node] = [length - share * length, 0.0, mine]
    return True


def remove_leaf(nodes: Nodes, node: int) -> bool:
    """A childless node goes, if the tree keeps at least two besides the root."""
    parent = nodes.parent[node]
    if not nodes.alive[node] or nodes.children[node] or parent < 0 or nodes.count < LEAST_NODES:
        return False
    nodes.alive[node] = False
    nodes.children[parent].remove(node)
    return True


def joined(nodes: Nodes, node: int) -> tuple[float, float, float] | None:
    """Length and angle of the branch that replaces a node with one child and the two branches at it, and by how much
    the grandchild's own children must turn to keep their headings; None where a limit is in the way.

    With branches b at angle t and a at angle u, in the frame of the node before: b (cos t, sin t) + a (cos(t + u),
    sin(t + u)).
    """
    if nodes.parent[node] < 0 or len(nodes.children[node]) != 1:
        return None
    (after,) = nodes.children[node]
    b, t, _ = nodes.row[node]
    a, u, _ = nodes.row[after]
    x, y = b * cos(t) + a * cos(t + u), b * sin(t) + a * sin(t + u)
    length, angle = hypot(x, y), atan2(y, x)
    turn = t + u - angle
    if not nodes.within(length, angle):
        return None
    if not all(abs(nodes.row[child][1] + turn) <= nodes.limits.angle + SLACK for child in nodes.children[after]):
        return None
    return length, angle, turn


def remove_branch(nodes: Nodes, node: int) -> bool:
    """A node with one child goes, and the branch from its parent to that child is straight (SPEC 5.3): every other
    node keeps its place, and all but the child their headings."""
    new = joined(nodes, node) if nodes.alive[node] and nodes.count >= LEAST_NODES else None
    if new is None:
        return False
    length, angle, turn = new
    parent, (after,) = nodes.parent[node], nodes.children[node]
    for child in nodes.children[after]:
        nodes.row[child][1] += turn
    nodes.row[after][:2] = length, angle
    siblings = nodes.children[parent]
    siblings[siblings.index(node)] = after
    nodes.parent[after] = parent
    nodes.alive[node] = False
    nodes.children[node] = []
    return True


def drop_small(nodes: Nodes, least: float) -> bool:
    """Childless nodes with leaves under ``least`` go, and those that this leaves childless, and so on; True if any
    went."""
    stack = [node for node, alive in enumerate(nodes.alive) if alive and not nodes.children[node]]
    gone = False
    while stack:
        node = stack.pop()
        parent = nodes.parent[node]
        if parent < 0 or nodes.row[node][2] >= least:
            continue
        nodes.alive[node] = False
        nodes.children[parent].remove(node)
        gone = True
        if not nodes.children[parent]:
            stack.append(parent)
    return gone


def turned(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles in [-pi, pi)."""
    return np.asarray((angle + pi) % (2 * pi) - pi)


def chain_lengths(pose: Floats, point: tuple[float, float], limits: Limits) -> Floats:
    """Estimated number of nodes (n,) of a chain from every node to a point, infinite for points behind it (SPEC 5.4).

    It must turn by 2 psi within the angle limit at each joint, psi the point's bearing, and its chords span an arc that
    is psi / sin(psi) times as long as the distance.
    """
    dx, dy = point[0] - pose[:, 0], point[1] - pose[:, 1]
    bearing = np.abs(turned(np.arctan2(dy, dx) - pose[:, 2]))
    straightness = np.sinc(bearing / pi)
    with np.errstate(divide="ignore"):
        far = (np.hypot(dx, dy) / limits.length - 1) / np.maximum(straightness, 1e-9) + 1
    count = np.maximum(1.0, np.maximum(2 * bearing / limits.angle - 1, far))
    return np.where(bearing >= pi / 2, inf, count)


def chain_to(pose: Floats, point: tuple[float, float], estimate: float, limits: Limits) -> tuple[int, float, float]:
    """Number of nodes, branch length and turn at each of an exact chain from a pose (4,) to a point: equal chords of a
    circle. (0, 0, 0) if none of at most ten more nodes than estimated keeps to the limits."""
    dx, dy = point[0] - pose[0], point[1] - pose[1]
    far = hypot(dx, dy)
    bearing = float(turned(np.array(atan2(dy, dx) - pose[2])))
    start = int(np.ceil(estimate))
    for count in range(start, start + 11):
        half = bearing / (count + 1)
        span = sin(count * half) / sin(half) if abs(half) > 1e-9 else float(count)
        if abs(2 * half) <= limits.angle + SLACK and far <= limits.length * span:
            return count, far / span, 2 * half
    return 0, 0.0, 0.0


def shoots(rewrite: Rewrite) -> list[Shoot]:
    """The new nodes of an addition."""
    if rewrite.fit is not None:
        return [(float(a), float(b), float(c)) for a, b, c in rewrite.fit.reshape(-1, 3)]
    if rewrite.rule == "add-leaf":
        return [(rewrite.data[1], rewrite.data[2], rewrite.data[3])]
    _, count, length, turn, tip, link = rewrite.data
    return [(length, turn, link)] * (int(count) - 1) + [(length, turn, tip)]
