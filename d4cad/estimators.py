"""How the improvement by a rewrite is foretold: by stepping whole programs, or by a local fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from d4cad.canvas import Canvas
from d4cad.program import Program, Rewrite
from d4cad.protocols import Estimator, Grammar, Loss, Stepper, Trial
from d4cad.raster.band import Band

S = TypeVar("S")


@dataclass(frozen=True, slots=True)
class Stepped:
    """The paper's estimate: the rewritten program and the base both take ``steps`` steps, then are compared.

    Works with any grammar and loss. The improvement is measured against the base *after the same steps*, so that a
    rewrite is not credited with progress that the base would have made without it.
    """

    stepper: Stepper[Any]
    steps: int = 1

    def estimate(
        self,
        program: Program[S],
        rewrites: Sequence[Rewrite],
        grammar: Grammar[S],
        loss: Loss,
        canvas: Canvas,
        price: float,
    ) -> list[Trial]:
        """One trial per rewrite, in order."""
        base = self._total(program, grammar, loss, canvas, price)
        return [
            Trial(rewrite, base - self._total(grammar.apply(program, [rewrite]).program, grammar, loss, canvas, price))
            for rewrite in rewrites
        ]

    def _total(self, program: Program[S], grammar: Grammar[S], loss: Loss, canvas: Canvas, price: float) -> float:
        state = self.stepper.init(program)
        for _ in range(self.steps):
            evaluation = loss.evaluate(grammar.rasterize(program, canvas))
            params, state = self.stepper.step(program, evaluation, state)
            program = program.moved(params)
        _, value = self.stepper.best(program.params, loss.value(grammar.rasterize(program, canvas)), state)
        return value + price * grammar.complexity(program)


class LocalTrials(Protocol):
    """A grammar that can fit each rewrite on its own parameters inside the window it affects."""

    def local_trials(
        self, program: Program[Any], rewrites: Sequence[Rewrite], loss: Any, canvas: Canvas, price: float, steps: int
    ) -> list[Trial]:
        """The rewrites that pay, with their fitted values."""
        ...


@dataclass(frozen=True, slots=True)
class LocalFit:
    """A compiled estimate for a base that has settled: a few steps on the rewrite's own parameters only."""

    steps: int = 4

    def estimate(
        self, program: Program[S], rewrites: Sequence[Rewrite], grammar: Any, loss: Loss, canvas: Canvas, price: float
    ) -> list[Trial]:
        """Trials of the rewrites that pay, the fitted values in the rewrite."""
        trials: list[Trial] = grammar.local_trials(program, rewrites, loss, canvas, price, self.steps)
        return trials


@dataclass(frozen=True, slots=True)
class Frozen:
    """For a loss that changes with every evaluation: proposals are compared on the one that the round began with."""

    inner: Estimator

    def estimate(
        self, program: Program[S], rewrites: Sequence[Rewrite], grammar: Grammar[S], loss: Any, canvas: Canvas,
        price: float,
    ) -> list[Trial]:  # fmt: skip
        """The inner estimator's trials."""
        return self.inner.estimate(program, rewrites, grammar, loss.frozen(), canvas, price)


@dataclass(frozen=True, slots=True)
class Linearised:
    """For a loss that costs much and is known to first order: proposals by what it is near the base.

    The loss has ``pull(coverage)`` with ``near``, a squared error that is ``1 / scale`` of it there but for a constant
    (:class:`d4cad.objectives.distillation.Pull`): one evaluation serves all proposals.
    """

    inner: Estimator

    def estimate(
        self, program: Program[S], rewrites: Sequence[Rewrite], grammar: Grammar[S], loss: Any, canvas: Canvas,
        price: float,
    ) -> list[Trial]:  # fmt: skip
        """The inner estimator's trials, their gains in units of the loss."""
        pull = loss.pull(grammar.rasterize(program, canvas).coverage)
        trials = self.inner.estimate(program, rewrites, grammar, pull.near, canvas, price / pull.scale)
        return [Trial(trial.rewrite, trial.gain * pull.scale) for trial in trials]


class CostlyLoss(Loss, Protocol):
    """A loss that knows cheap stand-ins for itself."""

    @property
    def coarse(self) -> Loss:
        """The same loss at a lower resolution, on its own canvas."""
        ...

    @property
    def coarse_canvas(self) -> Canvas:
        """The canvas of ``coarse``."""
        ...

    def likeness(self, band: Band) -> Loss:
        """A squared error whose minimum is this raster."""
        ...


@dataclass(frozen=True, slots=True)
class Funnel:
    """For a :class:`CostlyLoss`: every rewrite at a lower resolution, the best few for real.

    A rewrite that simplifies is first fitted to the raster that the program has, which costs no evaluation of the loss.
    The ``finalists`` best by the coarse loss take ``steps`` steps, and so does the base.
    """

    stepper: Stepper[Any]
    finalists: int = 8
    steps: int = 1
    tries: int = 4

    def estimate(
        self, program: Program[S], rewrites: Sequence[Rewrite], grammar: Any, loss: Any, canvas: Canvas, price: float
    ) -> list[Trial]:
        """Trials of the finalists."""
        fewer = [r for r in rewrites if grammar.growth(program, r) < 0]
        others = [r for r in rewrites if grammar.growth(program, r) >= 0]
        likeness = loss.likeness(grammar.rasterize(program, canvas))
        # at a price so high that each of them pays
        fitted = grammar.local_trials(program, fewer, likeness, canvas, 1.0, self.tries)
        candidates = [trial.rewrite for trial in fitted] + others

        def rough(rewrite: Rewrite) -> float:
            there = grammar.apply(program, [rewrite]).program
            value: float = loss.coarse.value(grammar.rasterize(there, loss.coarse_canvas))
            return float(value + price * grammar.complexity(there))

        best = sorted(candidates, key=rough)[: self.finalists]
        return Stepped(self.stepper, self.steps).estimate(program, best, grammar, loss, canvas, price)
