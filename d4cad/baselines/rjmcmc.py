"""Reversible-jump Markov chain Monte Carlo on the derivations of a stochastic branching system.

After Talton, Lou, Lesser, Duke, Mech, Koltun, "Metropolis Procedural Modeling", ACM Transactions on Graphics 30(2),
2011, https://doi.org/10.1145/1944846.1944851: *jumps* derive a subtree anew from the system, *diffusions* move the
numbers of one symbol, and the temperature falls. The target is the density p(x) exp(-E(x) / T) with the system's own p.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import exp, log

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import InputError
from d4cad.program import Floats

Ints = NDArray[np.int64]
Random = np.random.Generator


@dataclass(frozen=True, slots=True, eq=False)
class Derivation:
    """A tree of symbols, depth first, so that a subtree is a stretch of it.

    parents: (n,), less than the symbol's own number, -1 for the first. numbers: (n, d). depths: (n,), of the first that
    of the symbol that it was derived from.
    """

    parents: Ints
    numbers: Floats
    depths: Ints

    @property
    def size(self) -> int:
        """Number of symbols."""
        return len(self.parents)

    def end(self, symbol: int) -> int:
        """The number after the last of a symbol's subtree."""
        others = np.flatnonzero(self.depths[symbol + 1 :] <= self.depths[symbol])
        return symbol + 1 + int(others[0]) if others.size else self.size

    def replaced(self, symbol: int, part: Derivation) -> Derivation:
        """The derivation with ``part`` in place of a symbol's subtree."""
        end = self.end(symbol)
        inner = part.parents + symbol
        inner[0] = self.parents[symbol]
        tail = self.parents[end:]
        outer = np.where(tail >= end, tail + part.size - (end - symbol), tail)
        return Derivation(
            np.concatenate([self.parents[:symbol], inner, outer]),
            np.concatenate([self.numbers[:symbol], part.numbers, self.numbers[end:]]),
            np.concatenate([self.depths[:symbol], part.depths, self.depths[end:]]),
        )


@dataclass(frozen=True, slots=True)
class BranchingSystem:
    """A context-free system: a symbol of depth k has i children with probability ``children[k][i]``, and d numbers that
    are uniform between ``low`` and ``high``.

    Symbols deeper than ``children`` has rows have no child. Raises InputError where the probabilities of a row do not
    sum to 1 or a range is empty.
    """

    children: tuple[tuple[float, ...], ...]
    low: tuple[float, ...]
    high: tuple[float, ...]

    def __post_init__(self) -> None:
        for row in self.children:
            if min(row, default=-1.0) < 0 or abs(sum(row) - 1) > 1e-9:
                raise InputError(f"the probabilities of numbers of children must sum to 1, got {row}")
        if len(self.low) != len(self.high) or not all(a < b for a, b in zip(self.low, self.high, strict=True)):
            raise InputError(f"the numbers' ranges must not be empty, got {self.low} to {self.high}")

    def derive(self, depth: int, rng: Random) -> Derivation:
        """A symbol of this depth with all that follows from it, drawn from the system."""
        parents, depths, stack = list[int](), list[int](), [(-1, depth)]
        while stack:
            parent, at = stack.pop()
            symbol = len(parents)
            parents.append(parent)
            depths.append(at)
            if at < len(self.children):
                total, count, draw = 0.0, -1, rng.random()
                while total <= draw and count + 1 < len(self.children[at]):
                    count += 1
                    total += self.children[at][count]
                stack += [(symbol, at + 1)] * count
        numbers = rng.uniform(self.low, self.high, (len(parents), len(self.low)))
        return Derivation(np.array(parents, np.int64), numbers, np.array(depths, np.int64))

    def log_probability(self, derivation: Derivation) -> float:
        """Logarithm of the probability of the derivation's tree, its numbers left out."""
        counts = np.bincount(derivation.parents[1:], minlength=derivation.size) if derivation.size > 1 else np.zeros(1)
        total = 0.0
        for count, depth in zip(counts.astype(int).tolist(), derivation.depths.tolist(), strict=True):
            row = self.children[depth] if depth < len(self.children) else (1.0,)
            if count >= len(row) or row[count] == 0:
                return -np.inf
            total += log(row[count])
        return total


Energy = Callable[[Derivation], float]


@dataclass(frozen=True, slots=True)
class Moves:
    """How a chain moves.

    jumps: share of jumps. focus: the symbol of a move is drawn with weights ``focus ** depth``: above 1 small subtrees
    are re-derived more often. spreads: standard deviations of a diffusion as shares of the ranges, one drawn each time.
    """

    jumps: float = 0.5
    focus: float = 1.0
    spreads: tuple[float, ...] = (0.3, 0.1, 0.03)

    def weights(self, derivation: Derivation) -> Floats:
        """Weights (n,) with which symbols are drawn."""
        return np.asarray(self.focus ** derivation.depths.astype(np.float64))

    def proposed(self, here: Derivation, system: BranchingSystem, rng: Random) -> tuple[Derivation, float]:
        """A proposal, and the logarithm of p(x') q(x | x') / (p(x) q(x' | x)).

        A jump draws the new subtree from the system itself, so that the densities of both subtrees cancel and only the
        choice of the symbol is left: w / sum(w(x')) over w / sum(w(x)), w the weight of the same symbol in both.
        """
        weights = self.weights(here)
        total = float(weights.sum())
        symbol = int(np.searchsorted(np.cumsum(weights), rng.random() * total, side="right"))
        symbol = min(symbol, here.size - 1)
        if rng.random() < self.jumps:
            there = here.replaced(symbol, system.derive(int(here.depths[symbol]), rng))
            return there, log(total / float(self.weights(there).sum()))
        low, high = np.array(system.low), np.array(system.high)
        spread = self.spreads[int(rng.integers(len(self.spreads)))]
        numbers = here.numbers.copy()
        numbers[symbol] = reflected(numbers[symbol] + rng.normal(size=low.size) * spread * (high - low), low, high)
        return Derivation(here.parents, numbers, here.depths), 0.0


def reflected(values: Floats, low: Floats, high: Floats) -> Floats:
    """Values folded back at the ends of their ranges, which keeps a symmetric move symmetric."""
    period = 2 * (high - low)
    within = np.mod(values - low, period)
    return np.asarray(low + np.minimum(within, period - within))


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A place of the chain."""

    derivation: Derivation
    energy: float


def step(here: State, system: BranchingSystem, energy: Energy, temperature: float, moves: Moves, rng: Random) -> State:
    """One Metropolis-Hastings-Green step: the proposal, or ``here`` where it is refused."""
    derivation, ratio = moves.proposed(here.derivation, system, rng)
    there = State(derivation, energy(derivation))
    odds = ratio - (there.energy - here.energy) / temperature
    return there if odds >= 0 or rng.random() < exp(odds) else here


@dataclass(frozen=True, slots=True)
class Annealing:
    """A temperature that falls geometrically from ``first`` to ``last``, in units of the energy."""

    first: float
    last: float

    def at(self, share: float) -> float:
        """The temperature when a share of the run is over, in [0, 1]."""
        return float(self.first * (self.last / self.first) ** min(max(share, 0.0), 1.0))
