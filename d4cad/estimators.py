"""How the improvement by a rewrite is foretold: by stepping whole programs, or by a local fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from d4cad.canvas import Canvas
from d4cad.program import Program, Rewrite
from d4cad.protocols import Grammar, Loss, Stepper, Trial

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
        return loss.value(grammar.rasterize(program, canvas)) + price * grammar.complexity(program)


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
