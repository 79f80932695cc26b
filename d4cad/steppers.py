"""Continuous optimisers: the paper's clipped gradient, Adam, and Levenberg-Marquardt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv

from d4cad.program import Curvature, Edit, Floats, Program
from d4cad.protocols import Evaluation

Bounds = Callable[[Program[Any]], tuple[Floats, Floats]]
"""The least and the greatest values (n,) that a program's parameters may have."""


@dataclass(frozen=True, slots=True)
class Rate:
    """State of the paper's adaptive learning rate: the rate, the best loss, and two counters (SPEC 1.5)."""

    rate: float
    best: float = inf
    bad: int = 0
    good: int = 0


@dataclass(frozen=True, slots=True)
class ClippedGradient:
    """Gradient descent with each component clipped and the paper's adaptive rate.

    The rate is halved after more than ``patience`` steps without a new best, and multiplied by sqrt(2) after more than
    ``patience`` steps that were not worse. As published, an edit keeps the rate and forgets the rest. ``metric`` gives
    for a program the step per unit of gradient and rate, (n,); None stands for ones.
    """

    rate: float = 0.5
    least: float = 1e-4
    clip: float = 2.0
    patience: int = 2
    threshold: float = 1e-4
    metric: Callable[[Program[Any]], Floats] | None = None
    bounds: Bounds | None = None

    def init(self, program: Program[Any]) -> Rate:
        """The full rate."""
        return Rate(self.rate)

    def carry(self, state: Rate, edit: Edit[Any]) -> Rate:
        """Only the rate persists."""
        return Rate(state.rate)

    def step(self, program: Program[Any], evaluation: Evaluation, state: Rate) -> tuple[Floats, Rate]:
        """One clipped step at the present rate, which then adapts to the loss."""
        slope = np.clip(evaluation.gradient, -self.clip, self.clip)
        if self.metric is not None:
            slope *= self.metric(program)
        moved = program.params - state.rate * slope
        if self.bounds is not None:
            moved = np.clip(moved, *self.bounds(program))
        return moved, self.adapt(evaluation.value, state)

    def adapt(self, value: float, state: Rate) -> Rate:
        """The rate after a step at which the loss was ``value``."""
        rate, best, bad, good = state.rate, state.best, state.bad, state.good
        good = 0 if value > best * (1 + self.threshold) else good + 1
        if value < best * (1 - self.threshold):
            best, bad = value, 0
        else:
            bad += 1
        if bad > self.patience:
            rate, bad, good = rate / 2, 0, 0
        if good > self.patience:
            rate, bad, good = rate * sqrt(2), 0, 0
        return Rate(min(max(rate, self.least), self.rate), best, bad, good)

    def best(self, params: Floats, value: float, state: Rate) -> tuple[Floats, float]:
        """The last parameters, as published."""
        return params, value

    def settled(self, state: Rate) -> bool:
        """Never: the number of steps decides."""
        return False


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Adam's running means of the gradient and of its square, (n,) each, and the number of steps behind each."""

    mean: Floats
    square: Floats
    count: Floats


@dataclass(frozen=True, slots=True)
class Adam:
    """Adam (Kingma and Ba 2015) whose moments follow their parameters through edits; a new parameter starts afresh."""

    rate: float = 0.01
    beta1: float = 0.9
    beta2: float = 0.99
    epsilon: float = 1e-12

    def init(self, program: Program[Any]) -> Moments:
        """Zero moments."""
        n = program.params.size
        return Moments(np.zeros(n), np.zeros(n), np.zeros(n))

    def carry(self, state: Moments, edit: Edit[Any]) -> Moments:
        """Each surviving parameter keeps its moments."""
        return Moments(edit.carry(state.mean), edit.carry(state.square), edit.carry(state.count))

    def step(self, program: Program[Any], evaluation: Evaluation, state: Moments) -> tuple[Floats, Moments]:
        """One bias-corrected step; the correction counts each parameter's own steps."""
        g = evaluation.gradient
        mean = self.beta1 * state.mean + (1 - self.beta1) * g
        square = self.beta2 * state.square + (1 - self.beta2) * g * g
        count = state.count + 1
        first = mean / (1 - self.beta1**count)
        second = square / (1 - self.beta2**count)
        return program.params - self.rate * first / (np.sqrt(second) + self.epsilon), Moments(mean, square, count)

    def best(self, params: Floats, value: float, state: Moments) -> tuple[Floats, float]:
        """The last parameters."""
        return params, value

    def settled(self, state: Moments) -> bool:
        """Never: the number of steps decides."""
        return False


@dataclass(frozen=True, slots=True, eq=False)
class Trust:
    """Levenberg-Marquardt's state: the damping, and the best parameters of this structure with their evaluation."""

    damping: float
    params: Floats | None = None
    evaluation: Evaluation | None = None
    done: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Dense:
    """An array (n, n) as a matrix that knows how to solve with itself: `d4cad.program.Curvature`."""

    matrix: Floats

    def __mul__(self, factor: float) -> Curvature:
        return Dense(self.matrix * factor)

    def diagonal(self) -> Floats:
        """The diagonal (n,)."""
        return np.diagonal(self.matrix).copy()

    def solve(self, shift: Floats, right: Floats) -> Floats | None:
        """By Cholesky's factors."""
        shifted = np.array(self.matrix)
        shifted[np.diag_indices_from(shifted)] += shift
        _, found, failed = dposv(shifted, right)
        return None if failed else np.asarray(found)


@dataclass(frozen=True, slots=True)
class LevenbergMarquardt:
    """Damped Gauss-Newton steps (Marquardt 1963: the damping scales the curvature's diagonal).

    A step that raised the loss is taken back by the next one, at ``factor`` times the damping, and one that lowered it
    is followed by one at a ``factor``-th; 1 leaves the damping constant. ``reach``: the longest change
    of one parameter in a step. ``tolerance``: the relative decrease of the loss under which the program is settled;
    ``least``: a loss so small that it is settled anyway. ``bounds``: what the parameters must keep to; those at a bound
    that the loss pushes against rest for the step (the projected Newton method, Bertsekas 1982).
    """

    damping: float = 1e-3
    reach: float = 0.1
    tolerance: float = 1e-4
    least: float = 1e-17
    bounds: Bounds | None = None
    factor: float = 10.0

    def init(self, program: Program[Any]) -> Trust:
        """No step taken yet."""
        return Trust(self.damping)

    def carry(self, state: Trust, edit: Edit[Any]) -> Trust:
        """An edited program has no evaluated point yet."""
        return Trust(self.damping)

    def step(self, program: Program[Any], evaluation: Evaluation, state: Trust) -> tuple[Floats, Trust]:
        """From the better of the present and the best point, one damped step."""
        if evaluation.curvature is None:
            raise ValueError("Levenberg-Marquardt needs a loss that is a sum of squares")
        damping, done = state.damping, False
        if state.evaluation is None or state.params is None or evaluation.value < state.evaluation.value:
            if state.evaluation is not None:
                damping = max(damping / self.factor, 1e-9)
                done = state.evaluation.value - evaluation.value <= self.tolerance * state.evaluation.value
            at, here = program.params, evaluation
        else:
            damping *= self.factor
            at, here = state.params, state.evaluation
        done = done or damping > 1e4 or here.value <= self.least
        if self.bounds is None:
            return at + self._increment(here, damping), Trust(damping, at, here, done)
        low, high = self.bounds(program)
        resting = ((at <= low) & (here.gradient > 0)) | ((at >= high) & (here.gradient < 0))
        moved = np.clip(at + self._increment(here, damping, resting), low, high)
        return moved, Trust(damping, at, here, done)

    def _increment(self, here: Evaluation, damping: float, resting: NDArray[np.bool_] | None = None) -> Floats:
        """The damped step, shortened to the reach; the damping grows until the matrix is positive definite.

        resting: the parameters that keep their values.
        """
        curvature = Dense(here.curvature) if isinstance(here.curvature, np.ndarray) else here.curvature
        assert curvature is not None
        diagonal = curvature.diagonal()
        floor = 1e-9 * max(float(diagonal.max(initial=0.0)), 1e-300)
        right, rest = -here.gradient, np.zeros_like(diagonal)
        if resting is not None:
            right[resting] = 0.0
            rest[resting] = 1e18 * floor  # so stiff that the others do not count on them
        found: Floats | None = right if diagonal.size == 0 else None
        while found is None:
            found = curvature.solve(damping * diagonal + floor + rest, right)
            damping = max(10 * damping, 1e-6)
        if resting is not None:
            found[resting] = 0.0
        longest = float(np.abs(found).max(initial=0.0))
        return found * min(1.0, self.reach / longest) if longest > 0 else found

    def best(self, params: Floats, value: float, state: Trust) -> tuple[Floats, float]:
        """The better of the last and the best point."""
        if state.params is None or state.evaluation is None or value < state.evaluation.value:
            return params, value
        return state.params, state.evaluation.value

    def settled(self, state: Trust) -> bool:
        """Whether the last step gained nearly nothing."""
        return state.done


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """State of a constrained descent: the step's length in the metric, the best point and its evaluation."""

    length: float
    params: Floats | None = None
    evaluation: Evaluation | None = None
    done: bool = False


@dataclass(frozen=True, slots=True)
class NullSpace:
    """Descent along a constraint: Feppon, Allaire and Dapogny, "Null space gradient flows" (2020), in a metric M.

    With g and h the gradients of loss and constraint, the step is -a M^-1 (g - l h), l such that it keeps the
    constraint to first order, plus the shortest step that restores it, -c M^-1 h / (h' M^-1 h). ``length``: of the
    first step and ``reach`` of the longest, in the root of the metric's square; ``restore``: of the longest restoring
    one. A step that raised the loss is taken back and both its parts are tried at a third of their length; one that
    lowered it lets the next be longer by ``growth``. ``tolerance``: relative decrease under which the program is
    settled.
    """

    length: float = 3.0
    reach: float = 30.0
    restore: float = 30.0
    growth: float = 1.5
    least: float = 0.01
    tolerance: float = 1e-5
    damping: float = 1e-3

    def init(self, program: Program[Any]) -> Flow:
        """No step taken yet."""
        return Flow(self.length)

    def carry(self, state: Flow, edit: Edit[Any]) -> Flow:
        """An edited program has no evaluated point yet; the length persists."""
        return Flow(max(state.length, self.length))

    def step(self, program: Program[Any], evaluation: Evaluation, state: Flow) -> tuple[Floats, Flow]:
        """From the better of the present and the best point, one step."""
        at, here, length, done = program.params, evaluation, state.length, False
        if state.evaluation is not None and state.params is not None:
            gain = state.evaluation.value - evaluation.value
            if gain > 0:
                length = min(length * self.growth, self.reach)
                done = gain <= self.tolerance * evaluation.value
            else:
                at, here, length = state.params, state.evaluation, length / 3
                done = length < self.least
        return at + self._direction(here, length), Flow(length, at, here, done)

    def restoring(self, here: Evaluation) -> Floats:
        """The shortest step (n,) that fulfils the constraint to first order; zeros where nothing moves it."""
        return self._parts(here)[2]

    def _direction(self, here: Evaluation, length: float) -> Floats:
        metric, along, back = self._parts(here)

        down, up = (sqrt(max(float(part @ metric @ part), 0.0)) for part in (along, back))
        move = along * (length / down) if down > 0 else np.zeros_like(along)
        most = self.restore * min(1.0, length / self.length)
        return np.asarray(move + back * min(1.0, most / max(up, 1e-300)))

    def _parts(self, here: Evaluation) -> tuple[Floats, Floats, Floats]:
        """The metric, the way down along the constraint, of any length, and the whole restoring step."""
        if here.curvature is None or here.constraint is None:
            raise ValueError("a null space step needs a metric and a constraint")
        metric = np.array(here.curvature)
        diagonal = np.diagonal(metric).copy()
        h = here.constraint.gradient
        if not diagonal.any():  # nothing moves anything: a part that has left its canvas
            return metric, np.zeros_like(h), np.zeros_like(h)
        np.fill_diagonal(metric, diagonal * (1 + self.damping) + 0.01 * diagonal.mean())
        _, both, failed = dposv(metric, np.stack([here.gradient, h], axis=1))
        if failed:
            raise ValueError("the metric of a null space step is not positive definite")
        down, across = both.T
        grip = float(h @ across)
        if grip <= 0:
            return metric, -down, np.zeros_like(across)
        return metric, across * (float(h @ down) / grip) - down, across * (-here.constraint.residual / grip)

    def best(self, params: Floats, value: float, state: Flow) -> tuple[Floats, float]:
        """The better of the last and the best point."""
        if state.params is None or state.evaluation is None or value < state.evaluation.value:
            return params, value
        return state.params, state.evaluation.value

    def settled(self, state: Flow) -> bool:
        """Whether the last steps gained nearly nothing."""
        return state.done
