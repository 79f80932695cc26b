"""The continuous optimisers: facts of each, and state that survives rewriting."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
import pytest

from d4cad.program import Edit, Floats, Program
from d4cad.protocols import Evaluation
from d4cad.steppers import Adam, ClippedGradient, LevenbergMarquardt, Moments, Rate


def rosenbrock(params: Floats) -> Evaluation:
    """Residuals 1 - x and 10 (y - x^2): the minimum is 0 at (1, 1)."""
    x, y = params
    residual = np.array([1 - x, 10 * (y - x * x)])
    jacobian = np.array([[-1.0, 0.0], [-20 * x, 10.0]])
    return Evaluation(float(residual @ residual), 2 * jacobian.T @ residual, 2 * jacobian.T @ jacobian)


def run(stepper: LevenbergMarquardt, start: Floats, steps: int) -> tuple[Floats, float]:
    program = Program((), start)
    state = stepper.init(program)
    for _ in range(steps):
        params, state = stepper.step(program, rosenbrock(program.params), state)
        program = program.moved(params)
    return stepper.best(program.params, rosenbrock(program.params).value, state)


def test_levenberg_marquardt_finds_the_end_of_a_curved_valley() -> None:
    params, value = run(LevenbergMarquardt(reach=1.0), np.array([-1.2, 1.0]), 60)
    assert value < 1e-20
    assert params == pytest.approx([1, 1], abs=1e-9)


@pytest.mark.parametrize("steps", range(1, 12))
def test_levenberg_marquardt_never_ends_worse_than_it_began(steps: int) -> None:
    start = np.array([-1.2, 1.0])
    assert run(LevenbergMarquardt(damping=1e-9, reach=9.0), start, steps)[1] <= rosenbrock(start).value


def test_levenberg_marquardt_takes_back_a_step_that_raised_the_loss() -> None:
    stepper, start = LevenbergMarquardt(), Program((), np.array([0.5, 0.5]))
    good = rosenbrock(start.params)
    moved, state = stepper.step(start, good, stepper.init(start))
    worse = Evaluation(good.value + 1, good.gradient, good.curvature)
    again, after = stepper.step(start.moved(moved), worse, state)
    assert after.damping == pytest.approx(10 * state.damping)
    assert np.linalg.norm(again - start.params) < np.linalg.norm(moved - start.params)


def test_levenberg_marquardt_steps_no_further_than_its_reach() -> None:
    stepper, start = LevenbergMarquardt(reach=0.01), Program((), np.array([-1.2, 1.0]))
    moved, _ = stepper.step(start, rosenbrock(start.params), stepper.init(start))
    assert np.abs(moved - start.params).max() == pytest.approx(0.01)


def test_levenberg_marquardt_bears_a_parameter_without_influence() -> None:
    stepper, start = LevenbergMarquardt(), Program((), np.array([1.0, 5.0]))
    flat = Evaluation(1.0, np.array([2.0, 0.0]), np.array([[2.0, 0.0], [0.0, 0.0]]))
    moved, _ = stepper.step(start, flat, stepper.init(start))
    assert moved[0] < 1
    assert moved[1] == pytest.approx(5)


def test_levenberg_marquardt_settles_when_a_step_gains_nearly_nothing() -> None:
    stepper, start = LevenbergMarquardt(), Program((), np.array([0.5, 0.5]))
    first = rosenbrock(start.params)
    _, state = stepper.step(start, first, stepper.init(start))
    assert not stepper.settled(state)
    _, state = stepper.step(start, Evaluation(first.value * (1 - 1e-6), first.gradient, first.curvature), state)
    assert stepper.settled(state)


def test_levenberg_marquardt_refuses_a_loss_without_curvature() -> None:
    stepper, start = LevenbergMarquardt(), Program((), np.zeros(1))
    with pytest.raises(ValueError, match="sum of squares"):
        stepper.step(start, Evaluation(1.0, np.ones(1)), stepper.init(start))


# The paper's adaptive rate (SPEC 1.5), patience 2: state, loss -> state.
@pytest.mark.parametrize(
    ("state", "value", "after"),
    [
        (Rate(0.2), 1.0, Rate(0.2, 1.0, 0, 1)),
        (Rate(0.2, 1.0, 0, 1), 0.5, Rate(0.2, 0.5, 0, 2)),
        (Rate(0.2, 1.0, 0, 2), 0.5, Rate(0.2 * sqrt(2), 0.5, 0, 0)),
        (Rate(0.2, 1.0, 1, 1), 2.0, Rate(0.2, 1.0, 2, 0)),
        (Rate(0.2, 1.0, 2, 1), 2.0, Rate(0.1, 1.0, 0, 0)),
        (Rate(0.2, 1.0, 2, 2), 1.0, Rate(0.1, 1.0, 0, 0)),  # a plateau raises both counters, and halves
        (Rate(0.5, 1.0, 0, 2), 0.5, Rate(0.5, 0.5, 0, 0)),  # never above the first rate
        (Rate(1e-4, 1.0, 2, 0), 2.0, Rate(1e-4, 1.0, 0, 0)),  # nor under the least
    ],
)
def test_adaptive_rate(state: Rate, value: float, after: Rate) -> None:
    found = ClippedGradient().adapt(value, state)
    assert (found.best, found.bad, found.good) == (after.best, after.bad, after.good)
    assert found.rate == pytest.approx(after.rate)


def test_clipped_gradient_clips_each_component_then_scales_it() -> None:
    stepper = ClippedGradient(metric=lambda program: np.array([1.0, 10.0, 1.0]))
    start = Program((), np.zeros(3))
    moved, _ = stepper.step(start, Evaluation(1.0, np.array([5.0, -5.0, 0.5])), Rate(0.5))
    assert moved == pytest.approx([-1.0, 10.0, -0.25])


def test_an_edit_keeps_only_the_rate() -> None:
    edit = Edit(Program((), np.zeros(1)), np.array([0]))
    assert ClippedGradient().carry(Rate(0.1, 3.0, 2, 1), edit) == Rate(0.1, inf, 0, 0)


def test_adam_follows_its_definition() -> None:
    """Kingma and Ba 2015, algorithm 1: the first step is the rate against the gradient's sign."""
    stepper, start = Adam(rate=0.1), Program((), np.zeros(2))
    moved, state = stepper.step(start, Evaluation(1.0, np.array([3.0, -0.01])), stepper.init(start))
    assert moved == pytest.approx([-0.1, 0.1], rel=1e-6)
    moved, state = stepper.step(start.moved(moved), Evaluation(1.0, np.array([1.0, -0.01])), state)
    mean = (0.9 * 0.3 + 0.1 * 1.0) / (1 - 0.9**2)
    square = (0.99 * 0.09 + 0.01 * 1.0) / (1 - 0.99**2)
    assert moved[0] == pytest.approx(-0.1 - 0.1 * mean / sqrt(square))


def test_adam_carries_the_moments_of_surviving_parameters() -> None:
    state = Moments(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]), np.array([7.0, 7.0, 7.0]))
    carried = Adam().carry(state, Edit(Program((), np.zeros(4)), np.array([2, -1, 0, 1])))
    assert carried.mean.tolist() == [3, 0, 1, 2]
    assert carried.square.tolist() == [6, 0, 4, 5]
    assert carried.count.tolist() == [7, 0, 7, 7]


def test_a_new_parameter_starts_with_its_own_bias_correction() -> None:
    stepper = Adam(rate=0.1)
    old = Moments(np.array([0.5]), np.array([0.25]), np.array([1000.0]))
    edit = Edit(Program((), np.zeros(2)), np.array([0, -1]))
    moved, _ = stepper.step(edit.program, Evaluation(1.0, np.array([0.5, 0.5])), stepper.carry(old, edit))
    assert moved == pytest.approx([-0.1, -0.1], rel=0.02)
