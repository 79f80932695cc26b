"""Local trials: what they promise is what the whole picture shows, in any window and beside any other edges."""

from __future__ import annotations

import numpy as np
import pytest

from d4cad.canvas import Canvas
from d4cad.estimators import LocalFit
from d4cad.grammars.arc_line import ArcLine
from d4cad.grammars.arc_line.grammar import RULES
from d4cad.grammars.arc_line.structure import Structure
from d4cad.objectives.image import ImageLoss
from d4cad.program import Program, Rewrite
from d4cad.protocols import Trial
from d4cad.shapes import generate
from d4cad.sketch import Sketch

PRICE = 1e-6


def as_program(sketch: Sketch) -> Program[Structure]:
    points = [number for loop in sketch.loops for point in loop.points for number in point]
    bulges = [b for loop in sketch.loops for b in loop.bulges]
    structure = Structure(tuple(len(loop.points) for loop in sketch.loops), tuple(b != 0 for b in bulges))
    return Program(structure, np.array([*points, *(b for b in bulges if b != 0)]))


class Case:
    """A generated part, its picture, and a program that is off by a third of a pixel."""

    def __init__(self, canvas: Canvas, seed: int, primitives: int) -> None:
        # Without the ties of joints, which are not fitted in a window: test_joints.py has them.
        self.canvas, self.grammar = canvas, ArcLine(canvas.pixel, frozenset(RULES))
        truth = as_program(generate(np.random.default_rng(seed), primitives))
        rng = np.random.default_rng(seed)
        self.program = truth.moved(truth.params + rng.normal(scale=canvas.pixel / 3, size=truth.params.size))
        self.loss = ImageLoss.of(self.grammar.rasterize(truth, canvas).coverage)
        demand = self.loss.demand(self.grammar.rasterize(self.program, canvas))
        self.rewrites = self.grammar.rewrites(self.program, demand, canvas, rng)
        self.rewrites += [Rewrite("add-loop", frozenset(), (0.0, x, 0.1, r)) for x in (-0.4, 0.3) for r in (0.1, -0.1)]

    def trials(self, price: float = PRICE, steps: int = 4) -> list[Trial]:
        return LocalFit(steps).estimate(self.program, self.rewrites, self.grammar, self.loss, self.canvas, price)

    def total(self, program: Program[Structure], price: float = PRICE) -> float:
        loss = self.loss.value(self.grammar.rasterize(program, self.canvas))
        return loss + price * self.grammar.complexity(program)


CANVASES = [Canvas.square(128), Canvas(150, 96, 3 / 150), Canvas(90, 128, 3 / 128, 1.7)]


@pytest.mark.parametrize("primitives", [8, 30])
@pytest.mark.parametrize("canvas", CANVASES, ids=str)
def test_gain_is_that_of_the_applied_rewrite(canvas: Canvas, primitives: int) -> None:
    case = Case(canvas, 3, primitives)
    trials = case.trials()
    assert len({trial.rewrite.rule for trial in trials}) >= 4
    before = case.total(case.program)
    for trial in trials:
        applied = case.grammar.apply(case.program, [trial.rewrite]).program
        assert trial.gain == pytest.approx(before - case.total(applied), rel=1e-6, abs=1e-9), trial.rewrite


def test_more_steps_do_not_lose() -> None:
    case = Case(Canvas.square(128), 1, 12)
    gains = [
        {t.rewrite.data: t.gain for t in case.trials(steps=steps) if t.rewrite.rule == "split"} for steps in (1, 4)
    ]
    assert gains[0]
    assert all(gains[1][data] >= gain for data, gain in gains[0].items())


def test_a_price_above_all_error_leaves_no_growth() -> None:
    case = Case(Canvas.square(128), 1, 12)
    assert all(case.grammar.growth(case.program, trial.rewrite) < 0 for trial in case.trials(price=1.0))


def test_nothing_to_gain_at_the_truth() -> None:
    case = Case(Canvas.square(128), 2, 12)
    loss = ImageLoss.of(case.grammar.rasterize(case.program, case.canvas).coverage)
    estimate = LocalFit(4).estimate(case.program, case.rewrites, case.grammar, loss, case.canvas, PRICE)
    assert all(case.grammar.growth(case.program, trial.rewrite) < 0 for trial in estimate)


def test_same_trials_same_bits() -> None:
    case = Case(Canvas.square(128), 4, 20)
    first, second = case.trials(), case.trials()
    assert [trial.gain for trial in first] == [trial.gain for trial in second]
    for one, other in zip(first, second, strict=True):
        assert one.rewrite.fit is not None
        assert other.rewrite.fit is not None
        np.testing.assert_array_equal(one.rewrite.fit, other.rewrite.fit)
