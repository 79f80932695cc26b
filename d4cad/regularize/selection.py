"""Which relations to believe: a greedy choice by evidence, in the linear approximation.

A relation of r independent equations is compared with the alternative that its residuals are spread evenly over a
range. In nats, by Bayes' rule and Laplace's approximation (MacKay 2003, "Information Theory, Inference, and Learning
Algorithms", 28.1), it gains

    sum over the r equations of log(range / (sqrt(2 pi) sigma)) - T / 2 - price

with sigma the equation's standard deviation given what is believed already and T the sum of squared residuals in units
of it: a parameter that need not be told earns its bits, and the loss that it costs is paid for in noise variances.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import log, pi, sqrt
from typing import NamedTuple

import numpy as np

from d4cad.edges import Floats
from d4cad.regularize.equations import Equations
from d4cad.relations import Relation

LIMIT = 4.5
"""Largest residual of a believed equation, in standard deviations."""
IMPLIED = 1e-3
"""An equation whose rows keep less than this share of their length across the believed ones follows from them."""
LOOSE = 0.2
"""Largest residual of an implied equation in its standard deviations before anything was believed: what linearisation
leaves."""

TOLD = frozenset(("horizontal", "vertical", "tangent", "equal_radius", "concentric"))
"""Kinds of relations that are told even where they follow from others."""

LATER = {"symmetric": 1, "congruent": 1, "polar": 1, "row": 1, "equal_length": 2, "angle": 2}
"""Kinds that are not looked at first: patterns, which what holds of single edges may explain, and what patterns may."""


class Candidate(NamedTuple):
    """relation: what might hold. price: nats by which it is less likely beforehand than not. spread: how large its
    residual is if it does not hold, None for that of its equations.
    """

    relation: Relation
    price: float
    spread: float | None = None


class Verdict(NamedTuple):
    """gain: nats. rank: independent equations. step: (n,) the move that fulfils them. basis: (rank, n) their rows."""

    gain: float
    rank: int
    step: Floats
    basis: Floats


@dataclass(eq=False)
class Belief:
    """What is believed so far: a subspace of moves that it forbids, and the least move that fulfils it.

    basis: (n, k) orthonormal, in standard deviations. move: (n,).
    """

    basis: Floats
    move: Floats

    @classmethod
    def nothing(cls, size: int) -> Belief:
        """No relation yet."""
        return cls(np.zeros((size, 0)), np.zeros(size))

    def verdict(self, system: Equations, price: float) -> Verdict | None:
        """How believable a relation is whose rows are given in standard deviations; None if it contradicts,
        or if it says nothing: a line and an arc always mirror themselves."""
        rows, residual = system.rows, system.residual
        own = np.linalg.norm(rows, axis=1)
        if own.size == 0 or np.any(own == 0) or not np.all(np.isfinite(own)):
            return None
        residual = (residual + rows @ self.move) / own
        rows = rows / own[:, None]
        across = rows - (rows @ self.basis) @ self.basis.T
        across -= (across @ self.basis) @ self.basis.T  # once more: cancellation leaves some of it
        left, size, right = np.linalg.svd(across, full_matrices=False)
        rank = int(np.count_nonzero(size > IMPLIED))
        shares = left.T @ residual
        step = -(shares[:rank] / size[:rank]) @ right[:rank]
        if np.any(np.abs(residual + across @ step) > LOOSE):
            return None
        surprise = float(step @ step)
        if np.any(np.abs(shares[:rank] / size[:rank]) > LIMIT) or surprise > rank + LIMIT * sqrt(2 * rank):
            return None
        # Of the m given equations' spreads, the r independent ones share the geometric mean.
        mean_range = float(np.mean(np.log(system.spread / own)))
        gain = rank * (mean_range - 0.5 * log(2 * pi)) - float(np.log(size[:rank]).sum()) - surprise / 2 - price
        return Verdict(gain, rank, step, right[:rank])

    def believe(self, verdict: Verdict) -> None:
        """Take a relation in."""
        self.basis = np.concatenate([self.basis, verdict.basis.T], axis=1)
        self.move = self.move + verdict.step


def believed(candidates: Iterable[tuple[Candidate, Equations]], belief: Belief) -> list[tuple[Candidate, int]]:
    """The candidates that are believable one after another, with the number of parameters that each takes.

    The most convincing come first, but for the order of ``LATER``. Each comes with its equations in standard
    deviations. Of those that follow from the ones before, only the kinds in ``TOLD`` are kept. ``belief`` takes all in.
    """
    alone = []
    for order, (candidate, system) in enumerate(candidates):
        verdict = belief.verdict(system, candidate.price)
        if verdict is not None and (verdict.gain > 0 or verdict.rank == 0):
            confidence = verdict.gain / max(verdict.rank, 1)
            alone.append((LATER.get(candidate.relation.kind, 0), -confidence, order, candidate, system))
    kept: list[tuple[Candidate, int]] = []
    for *_, candidate, system in sorted(alone, key=lambda entry: entry[:3]):
        verdict = belief.verdict(system, candidate.price)
        if verdict is None or (verdict.rank and verdict.gain <= 0):
            continue
        if verdict.rank == 0 and candidate.relation.kind not in TOLD:
            continue
        belief.believe(verdict)
        kept.append((candidate, verdict.rank))
    return kept
