"""The values that every room passes: programs, rewrites, edits, curvatures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
S = TypeVar("S")


@dataclass(frozen=True, slots=True, eq=False)
class Program(Generic[S]):
    """A shape program: what only rewriting changes, and what gradients move.

    ``structure``: immutable and hashable. ``params``: (n,) float64, world units and pure numbers.
    """

    structure: S
    params: Floats

    def moved(self, params: Floats) -> Program[S]:
        """The same structure with other parameters (n,)."""
        return replace(self, params=params)


@dataclass(frozen=True, slots=True, eq=False)
class Rewrite:
    """One concrete structural change, named data.

    ``rule``: name of the rule. ``sites``: what it touches; rewrites with disjoint sites may be applied
    together. ``data``: numbers the rule needs (a position, a radius), in world units. ``fit``: values
    for the parameters the rewrite may move, in the grammar's order, found by a trial; None leaves the
    ones the rule itself gives.
    """

    rule: str
    sites: frozenset[int]
    data: tuple[float, ...] = ()
    fit: Floats | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Edit(Generic[S]):
    """A changed program and where its parameters came from.

    ``origin``: (n,) int64, for each new parameter the index of the old one it continues, or -1.
    """

    program: Program[S]
    origin: NDArray[np.int64]

    def carry(self, values: Floats, fresh: float = 0.0) -> Floats:
        """Old per-parameter ``values`` (m,) in the order of the new parameters, ``fresh`` where new."""
        carried: Any = (
            np.where(self.origin >= 0, values[self.origin], fresh) if values.size else np.full(self.origin.shape, fresh)
        )
        return np.asarray(carried, dtype=np.float64)


class Curvature(Protocol):
    """A symmetric matrix (n, n) that knows how to solve with itself."""

    def __mul__(self, factor: float) -> Curvature:
        """The matrix times a number."""
        ...

    def diagonal(self) -> Floats:
        """The diagonal (n,)."""
        ...

    def solve(self, shift: Floats, right: Floats) -> Floats | None:
        """x (n,) with (matrix + diag(shift)) x = right, or None where that sum is not positive definite."""
        ...


def dense(curvature: Floats | Curvature | None) -> Floats:
    """The curvature where it must be an array (n, n), as every grammar but those with a chain has it."""
    if not isinstance(curvature, np.ndarray):
        raise TypeError(f"expected a curvature that is an array, got {type(curvature).__name__}")
    return curvature
