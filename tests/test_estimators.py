"""The funnel for costly losses and proposals on a frozen loss, on a language so small that all numbers are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from d4cad.canvas import Canvas
from d4cad.estimators import Frozen, Funnel, Stepped
from d4cad.objectives.fem import Grid, PlaneStress
from d4cad.objectives.paper_compliance import Controller, PaperCompliance
from d4cad.program import Edit, Floats, Program, Rewrite
from d4cad.protocols import Evaluation, Trial
from d4cad.raster.band import Band
from d4cad.steppers import Rate

CANVAS, COARSE = Canvas(8, 8, 1 / 4), Canvas(4, 4, 1 / 2)


@dataclass(frozen=True, slots=True)
class Number:
    """A language of one number: "set" gives it another value, "shrink" does so and lowers the complexity by one.

    A raster is that number and the width of its canvas.
    """

    fitted: list[tuple[list[Rewrite], Any, float, int]] = field(default_factory=list)

    def rasterize(self, program: Program[int], canvas: Canvas) -> Any:
        return float(program.params[0]), canvas.width

    def complexity(self, program: Program[int]) -> float:
        return float(program.structure)

    def growth(self, program: Program[int], rewrite: Rewrite) -> float:
        return -1.0 if rewrite.rule == "shrink" else 0.0

    def apply(self, program: Program[int], rewrites: Sequence[Rewrite]) -> Edit[int]:
        (rewrite,) = rewrites
        value = rewrite.data[0] if rewrite.fit is None else rewrite.fit[0]
        size = program.structure + int(self.growth(program, rewrite))
        return Edit(Program(size, np.array([float(value)])), np.array([-1]))

    def local_trials(
        self, program: Program[int], rewrites: Sequence[Rewrite], loss: Any, canvas: Canvas, price: float, steps: int
    ) -> list[Trial]:
        """Every simplification but those to a negative number, fitted to a tenth more."""
        self.fitted.append((list(rewrites), loss, price, steps))
        return [Trial(replace(r, fit=np.array([r.data[0] + 0.1])), 1.0) for r in rewrites if r.data[0] >= 0]


@dataclass(frozen=True, slots=True)
class Square:
    """The number's square; on the coarse canvas that of its distance to ``blind``."""

    blind: float = 0.0
    asked: list[tuple[float, int]] = field(default_factory=list)

    @property
    def coarse(self) -> Square:
        return Square(self.blind, self.asked)

    @property
    def coarse_canvas(self) -> Canvas:
        return COARSE

    def likeness(self, band: Any) -> tuple[str, Any]:
        return ("like", band)

    def value(self, band: Any) -> float:
        self.asked.append(band)
        number, width = band
        return float((number - (self.blind if width == COARSE.width else 0.0)) ** 2)

    def evaluate(self, band: Any) -> Evaluation:
        return Evaluation(band[0] ** 2, np.array([2 * band[0]]))


@dataclass(frozen=True, slots=True)
class Halving:
    """Half of the way to zero."""

    def init(self, program: Program[Any]) -> Rate:
        return Rate(1.0)

    def step(self, program: Program[Any], evaluation: Evaluation, state: Rate) -> tuple[Floats, Rate]:
        return program.params - 0.25 * evaluation.gradient, state

    def best(self, params: Floats, value: float, state: Rate) -> tuple[Floats, float]:
        return params, value


def offer(rule: str, value: float) -> Rewrite:
    return Rewrite(rule, frozenset(), (value,))


START = Program(5, np.array([4.0]))


def estimated(funnel: Any, rewrites: list[Rewrite], loss: Any, price: float = 0.0) -> tuple[list[Trial], Number]:
    grammar: Any = Number()
    return funnel.estimate(START, rewrites, grammar, loss, CANVAS, price), grammar


def test_gains_are_those_of_whole_programs_after_a_step_of_both() -> None:
    """The base goes from 4 to 2 in its step, a proposal of 1 to 0.5: 4 - 0.25 gained."""
    trials, _ = estimated(Funnel(Halving()), [offer("set", 1.0)], Square())  # type: ignore[arg-type]
    assert [trial.gain for trial in trials] == [pytest.approx(3.75)]


def test_only_the_best_few_by_the_coarse_loss_are_scored_for_real() -> None:
    loss = Square(blind=3.0)
    rewrites = [offer("set", value) for value in (0.0, 1.0, 2.5, 3.5, 6.0)]
    trials, _ = estimated(Funnel(Halving(), finalists=2), rewrites, loss)  # type: ignore[arg-type]
    assert sorted(trial.rewrite.data[0] for trial in trials) == [2.5, 3.5]
    assert [number for number, width in loss.asked if width == COARSE.width] == [0.0, 1.0, 2.5, 3.5, 6.0]
    assert len([1 for _, width in loss.asked if width == CANVAS.width]) == 3  # two finalists and the base


def test_the_price_counts_in_both_rounds() -> None:
    """Coarse: 1.1^2 less one of complexity against 1; for real the same after a step."""
    rewrites = [offer("set", 1.0), offer("shrink", 1.0)]
    for price, best in ((0.1, "set"), (0.5, "shrink")):
        (trial,), _ = estimated(Funnel(Halving(), finalists=1), rewrites, Square(), price)  # type: ignore[arg-type]
        assert trial.rewrite.rule == best
    assert trial.gain == pytest.approx(4 - 0.55**2 + 0.5)


def test_simplifications_are_fitted_to_the_raster_first() -> None:
    """At a price at which each pays; those that cannot be fitted are dropped, others are not fitted."""
    rewrites = [offer("set", 2.0), offer("shrink", 1.0), offer("shrink", -1.0)]
    trials, grammar = estimated(Funnel(Halving(), tries=3), rewrites, Square())  # type: ignore[arg-type]
    ((fitted, likeness, price, steps),) = grammar.fitted
    assert (fitted, likeness, price, steps) == (rewrites[1:], ("like", (4.0, 8)), 1.0, 3)
    found = {(trial.rewrite.rule, trial.rewrite.data[0]): trial.rewrite.fit for trial in trials}
    assert set(found) == {("set", 2.0), ("shrink", 1.0)}
    assert found["set", 2.0] is None
    assert found["shrink", 1.0] == pytest.approx([1.1])


def test_more_steps() -> None:
    trials, _ = estimated(Funnel(Halving(), steps=2), [offer("set", 8.0)], Square())  # type: ignore[arg-type]
    assert [trial.gain for trial in trials] == [pytest.approx(1.0 - 4.0)]


def test_proposals_do_not_advance_a_live_loss() -> None:
    """The paper's controller counts the steps of the base only, and all proposals see one multiplier."""
    grid = Grid(4, 4)
    fixed, loads = np.zeros(grid.size, dtype=np.bool_), np.zeros((grid.size, 1))
    fixed[2 * grid.nodes[0]] = fixed[2 * grid.nodes[0] + 1] = True
    loads[2 * grid.nodes[-1, 2] + 1] = -1.0
    controller = Controller(0.5)
    loss = PaperCompliance(PlaneStress.of(grid, fixed, loads), controller, 0.7)
    empty = np.zeros(0, np.int32)
    full = np.array([[row, 0, 4] for row in range(4)])
    band = Band(
        (4, 4), empty, empty, np.zeros(0), np.zeros(0, np.uint8), empty, np.zeros((0, 5)),
        np.zeros((0, 5), np.int64), full, 1,
    )  # fmt: skip
    loss.evaluate(band)
    before = replace(controller)

    @dataclass(frozen=True)
    class Full(Number):
        def rasterize(self, program: Program[int], canvas: Canvas) -> Any:
            return band

    @dataclass(frozen=True)
    class Still(Halving):
        def step(self, program: Program[Any], evaluation: Evaluation, state: Rate) -> tuple[Floats, Rate]:
            return program.params, state

    grammar: Any = Full()
    stepped = Stepped(Still(), 3)  # type: ignore[arg-type]
    trials = Frozen(stepped).estimate(START, [offer("shrink", 1.0)], grammar, loss, CANVAS, 0.25)
    assert [trial.gain for trial in trials] == [pytest.approx(0.25)]
    assert (controller.count, controller.summed, controller.multiplier) == (
        before.count, before.summed, before.multiplier,
    )  # fmt: skip
    stepped.estimate(START, [offer("shrink", 1.0)], grammar, loss, CANVAS, 0.25)
    assert controller.count == before.count + 6  # live, three steps of the base and of the proposal each count
