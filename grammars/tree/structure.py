"""What only rewriting changes in a Tree program, and how its parameters are laid out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import GrammarError
from d4cad.grammars.tree.leaves import POINTED, Leaf
from d4cad.program import Floats, Program

PER_NODE = 3
"""Numbers of a node other than the root: length, angle, size."""
ROOT_HEADING = pi / 2


@dataclass(frozen=True, slots=True)
class Limits:
    """What parameters must keep to, in world units and radians.

    Lengths lie in [0, length], angles in [-angle, angle], leaf sizes in [0, size]; with ``sized`` False leaf sizes are
    not parameters of the search and stay as they are.
    """

    length: float = 0.2
    angle: float = pi / 12
    size: float = 0.075
    sized: bool = True


@dataclass(frozen=True)
class Structure:
    """A rooted tree.

    parents: of every node, -1 for node 0, the root, and less than the node's own number for the others. root: the
    root's fixed place in world units. limits: of the parameters. leaf: the shape of all leaves. Parameters of a
    program: the root's leaf size; then of every other node the length of its branch, its angle against its parent's
    heading, and its leaf size. Lengths and sizes in world units, angles in radians, counter-clockwise; the root's
    heading is up.
    """

    parents: tuple[int, ...]
    root: tuple[float, float]
    limits: Limits = Limits()
    leaf: Leaf = POINTED

    def __post_init__(self) -> None:
        if not self.parents or self.parents[0] != -1:
            raise GrammarError(f"a tree starts with its root, whose parent is -1, got parents {self.parents[:3]}")
        for node, parent in enumerate(self.parents[1:], 1):
            if not 0 <= parent < node:
                raise GrammarError(f"the parent of node {node} must be a node before it, got {parent}")

    @cached_property
    def parent(self) -> NDArray[np.int64]:
        """The parents as an array (n,)."""
        return np.array(self.parents, np.int64)

    @cached_property
    def children(self) -> NDArray[np.int64]:
        """Number of children of every node (n,)."""
        return np.bincount(self.parent[1:], minlength=len(self.parents)).astype(np.int64)

    @cached_property
    def below(self) -> NDArray[np.int64]:
        """Number of nodes of every node's subtree, itself included, (n,)."""
        count = np.ones(len(self.parents), np.int64)
        for node in range(len(self.parents) - 1, 0, -1):
            count[self.parents[node]] += count[node]
        return count

    @property
    def size(self) -> int:
        """Number of parameters."""
        return 1 + PER_NODE * (len(self.parents) - 1)


def table_of(program: Program[Structure]) -> Floats:
    """Length, angle and leaf size of every node, (n, 3); the root has only a size."""
    return np.concatenate([[0.0, 0.0], program.params]).reshape(-1, PER_NODE)


def program_of(structure: Structure, table: Floats) -> Program[Structure]:
    """The inverse of :func:`table_of`."""
    return Program(structure, np.ascontiguousarray(table.ravel()[2:]))


def subtree_metric(program: Program[Structure]) -> Floats:
    """One over the number of nodes that a parameter's node carries: the paper's linear scaling (SPEC 2, "Scaling")."""
    metric = np.repeat(1.0 / program.structure.below, PER_NODE)[2:]
    metric[0] = 1.0
    return metric


def bounds(program: Program[Structure]) -> tuple[Floats, Floats]:
    """The least and the greatest values (n,) that the limits leave to the parameters."""
    limits = program.structure.limits
    count = len(program.structure.parents)
    low = np.tile([0.0, -limits.angle, 0.0], count)[2:]
    high = np.tile([limits.length, limits.angle, limits.size], count)[2:]
    if not limits.sized:
        low[::PER_NODE] = high[::PER_NODE] = program.params[::PER_NODE]
    return low, high
