"""The constrained stepper: known answers, what it keeps and restores, and steps that it takes back."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from d4cad.program import Edit, Floats, Program
from d4cad.protocols import Constraint, Evaluation
from d4cad.steppers import Flow, NullSpace

MIDDLE, NORMAL, LEVEL = np.array([3.0, -1.0, 2.0]), np.array([1.0, 2.0, -1.0]), 4.0


def bowl(params: Floats, metric: Floats | None = None) -> Evaluation:
    """|x - MIDDLE|^2 with a stiff merit for NORMAL x = LEVEL."""
    residual = float(NORMAL @ params - LEVEL)
    value = float(np.sum((params - MIDDLE) ** 2)) + 100 * residual**2
    curvature = np.eye(params.size) if metric is None else metric
    return Evaluation(value, 2 * (params - MIDDLE), curvature, Constraint(residual, NORMAL))


def run(stepper: NullSpace, start: Floats, steps: int, metric: Floats | None = None) -> tuple[Floats, Flow]:
    program = Program((), start)
    state = stepper.init(program)
    for _ in range(steps):
        params, state = stepper.step(program, bowl(program.params, metric), state)
        program = program.moved(params)
        if stepper.settled(state):
            break
    best, _ = stepper.best(program.params, bowl(program.params).value, state)
    return best, state


@pytest.mark.parametrize("start", [[0.0, 0.0, 0.0], [9.0, 9.0, -9.0], [3.0, -1.0, 2.0]])
def test_finds_the_nearest_point_of_a_plane(start: list[float]) -> None:
    """The projection of MIDDLE on the plane NORMAL x = LEVEL."""
    nearest = MIDDLE - NORMAL * (NORMAL @ MIDDLE - LEVEL) / (NORMAL @ NORMAL)
    found, state = run(NullSpace(length=0.5, least=1e-6), np.array(start), 200)
    assert found == pytest.approx(nearest, abs=0.01)
    assert NORMAL @ found == pytest.approx(LEVEL, abs=1e-5)
    assert state.done


def test_the_metric_does_not_move_the_answer() -> None:
    nearest = MIDDLE - NORMAL * (NORMAL @ MIDDLE - LEVEL) / (NORMAL @ NORMAL)
    metric = np.array([[4.0, 1.0, 0.0], [1.0, 2.0, 0.5], [0.0, 0.5, 1.0]])
    found, _ = run(NullSpace(length=0.5, least=1e-6), np.zeros(3), 300, metric)
    assert found == pytest.approx(nearest, abs=0.02)


@given(st.integers(0, 2**32 - 1))
def test_a_step_goes_down_along_the_constraint(seed: int) -> None:
    """On the constraint a step keeps it, has the asked length in the metric, and lowers the loss (by differences)."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3))
    metric = root @ root.T + 0.1 * np.eye(3)
    here = rng.normal(size=3)
    here -= NORMAL * (NORMAL @ here - LEVEL) / (NORMAL @ NORMAL)
    stepper = NullSpace(length=1e-4, damping=0.0)
    program = Program((), here)
    moved, _ = stepper.step(program, bowl(here, metric), stepper.init(program))
    way = moved - here
    assert NORMAL @ way == pytest.approx(0, abs=1e-12)
    damped = metric + 0.01 * np.mean(np.diagonal(metric)) * np.eye(3)
    assert sqrt(way @ damped @ way) == pytest.approx(1e-4, rel=1e-6)
    drop = bowl(here).value - bowl(moved).value
    assert drop > 0
    assert drop == pytest.approx(-bowl(here).gradient @ way, rel=1e-2, abs=1e-7)


def test_restores_a_linear_constraint_in_one_step() -> None:
    """The step along the shortest way: of all points of the plane the nearest, in the damped metric."""
    start = np.array([1.0, 1.0, 1.0])
    way = NullSpace().restoring(bowl(start))
    assert NORMAL @ (start + way) == pytest.approx(LEVEL)
    assert way == pytest.approx(NORMAL * (LEVEL - NORMAL @ start) / (NORMAL @ NORMAL))


def test_a_long_restoring_step_is_shortened() -> None:
    stepper, start = NullSpace(length=1e-9, restore=0.5, damping=0.0), Program((), 100 * NORMAL)
    moved, _ = stepper.step(start, bowl(start.params), stepper.init(start))
    assert np.linalg.norm(moved - start.params) * sqrt(1.01) == pytest.approx(0.5)


def test_a_step_that_raised_the_loss_is_taken_back() -> None:
    """Both its parts are tried at a third."""
    stepper, start = NullSpace(length=0.3, restore=0.3), Program((), 100 * NORMAL)
    good = bowl(start.params)
    moved, state = stepper.step(start, good, stepper.init(start))
    again, after = stepper.step(start.moved(moved), replace(good, value=good.value + 1), state)
    assert after.length == pytest.approx(0.1)
    assert again - start.params == pytest.approx((moved - start.params) / 3)
    for value, expected in ((good.value + 1, (start.params, good.value)), (good.value - 1, (moved, good.value - 1))):
        params, least = stepper.best(moved, value, state)
        assert params == pytest.approx(expected[0])
        assert least == expected[1]


def test_a_constraint_that_nothing_moves_is_left() -> None:
    here = Evaluation(1.0, np.array([1.0, 0.0]), np.eye(2), Constraint(5.0, np.zeros(2)))
    assert not NullSpace().restoring(here).any()
    moved, _ = NullSpace(length=2.0, damping=0.0).step(Program((), np.zeros(2)), here, Flow(2.0))
    assert moved * sqrt(1.01) == pytest.approx([-2, 0])


def test_a_part_that_nothing_moves_stays() -> None:
    """As when it has left its canvas: no parameter changes the raster."""
    nothing = Evaluation(1.0, np.zeros(2), np.zeros((2, 2)), Constraint(-5.0, np.zeros(2)))
    moved, _ = NullSpace().step(Program((), np.ones(2)), nothing, Flow(2.0))
    assert moved.tolist() == [1, 1]


def test_settled_where_steps_gain_nothing() -> None:
    stepper = NullSpace()
    here = Program((), MIDDLE)
    _, state = stepper.step(here, bowl(MIDDLE), stepper.init(here))
    same = bowl(MIDDLE)
    _, state = stepper.step(here, replace(same, value=same.value * (1 - 1e-9)), state)
    assert stepper.settled(state)
    edited = stepper.carry(state, Edit(here, np.arange(3)))
    assert not stepper.settled(edited)
    assert edited.evaluation is None


def test_needs_a_metric_and_a_constraint() -> None:
    here = Program((), np.zeros(1))
    with pytest.raises(ValueError, match="needs a metric and a constraint"):
        NullSpace().step(here, Evaluation(1.0, np.ones(1)), Flow(1.0))
    broken = Evaluation(1.0, np.ones(2), np.array([[1.0, 5.0], [5.0, 1.0]]), Constraint(0.0, np.ones(2)))
    with pytest.raises(ValueError, match="not positive definite"):
        NullSpace().step(Program((), np.zeros(2)), broken, Flow(1.0))
