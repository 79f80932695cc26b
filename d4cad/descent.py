"""Stochastic Rewrite Descent: Algorithm 1 (`descend`) and Algorithm 2 (`compatible`) of the paper."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from math import inf, log10
from typing import Any, Generic, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from d4cad.canvas import Canvas
from d4cad.interrupts import Interrupts, postponed
from d4cad.program import Program, Rewrite, dense
from d4cad.protocols import STIFF, Bonded, Estimator, Evaluation, Grammar, Loss, Objective, Stepper, Trial

S = TypeVar("S")

BINDINGS = 3
"""At most so many times are bonds looked for after a rewrite."""


class Stop(Enum):
    """Why a run ended, in words."""

    STALLED = "no rewrite pays for itself at the last price of a primitive"
    PATIENCE = "the loss did not improve for the allowed number of rounds"
    ROUNDS = "the allowed number of rounds was used"
    TIME = "the time limit was reached"
    INTERRUPTED = "the run was interrupted"


@dataclass(frozen=True, slots=True)
class Stage:
    """A stretch of the search at one edge model and one price.

    ramp: half-width of the coverage ramp in pixels. price: loss that one unit of complexity may cost. rounds: at most
    so many rounds of steps and rewrites. patience: rounds without a relative gain of ``tolerance`` before the stage
    ends. without: names of rules that are not used in it. growth: by so much the primitives may become more since the
    last stage without such a limit; a search that needs more goes back to where that ended, past all stages with a
    limit. More that would have paid at half of that stage's price does not count. fallback: whether the stage is for a
    search that went back only.
    """

    ramp: float
    price: float
    rounds: int
    patience: int = 0
    tolerance: float = 0.0
    without: frozenset[str] = frozenset()
    growth: float = inf
    fallback: bool = False


@dataclass(frozen=True, slots=True)
class Method:
    """Settings of the search.

    stages: one after another. rhythm: numbers of gradient steps, each followed by a repair. stepper: the continuous
    optimiser. estimator: how rewrites are scored. sample: how many proposals a round scores, None for all; ``reserved``
    maps a rule to the share of the sample kept for it. recheck: whether a chosen set must lower the objective after a
    full run of steps, else its best third is tried, and so on down to one. accept: at most so many rewrites of a round
    are applied, None for all that are compatible.
    """

    stages: tuple[Stage, ...]
    rhythm: tuple[int, ...]
    stepper: Stepper[Any]
    estimator: Estimator
    sample: int | None = None
    reserved: tuple[tuple[str, float], ...] = ()
    recheck: bool = True
    accept: int | None = None


@dataclass(frozen=True, slots=True)
class Record:
    """One round: gradient steps so far, loss, primitives, rewrites accepted in it, seconds since the start."""

    step: int
    loss: float
    primitives: int
    accepted: int
    seconds: float

    @property
    def psnr(self) -> float:
        """-10 log10(loss) dB, at most 120: the peak signal-to-noise ratio if the loss is a mean squared error."""
        return min(120.0, -10 * log10(max(self.loss, 1e-12)))


@dataclass(frozen=True, slots=True, eq=False)
class Descent(Generic[S]):
    """What a run found: the best program, its loss, one record per round, and why it ended."""

    program: Program[S]
    loss: float
    history: tuple[Record, ...]
    stop: Stop


@dataclass(frozen=True, slots=True, eq=False)
class Point(Generic[S]):
    """A program on its way: stepper state, loss, loss plus simplicity, gradient steps taken to get there."""

    program: Program[S]
    state: Any
    loss: float = inf
    total: float = inf
    steps: int = 0


def descend(
    program: Program[S],
    grammar: Grammar[S],
    objective: Objective,
    canvas: Canvas,
    method: Method,
    rng: np.random.Generator,
    watch: Callable[[Record, Program[S]], None] | None = None,
    max_seconds: float = inf,
) -> Descent[S]:
    """Algorithm 1: gradient steps interleaved with sampled, scored and greedily combined rewrites.

    ``watch`` is called after every round. Ctrl-C (KeyboardInterrupt) or the end of ``max_seconds`` ends the run with
    the best program so far.
    """
    search = Search(grammar, canvas, method, watch, max_seconds)
    here = Point(program, method.stepper.init(program))
    best, stop = here, Stop.ROUNDS
    # on more threads small matrices are slower, and round as their number has it
    with postponed() as search.interrupts, threadpool_limits(limits=1):
        try:
            free, allowance, exceeded = here, method.stages[0].price, False
            for stage in method.stages:
                if stage.fallback is not exceeded and (stage.fallback or stage.growth < inf):
                    continue
                search.enter(stage)
                best, quiet, stop = replace(here, total=inf), 0, Stop.ROUNDS
                for _ in range(stage.rounds):
                    loss = objective.draw(rng)
                    here = search.settle(here, loss)
                    chosen = compatible(search.promising(here, loss, rng))[: method.accept]
                    there, accepted = search.combine(here, chosen, loss)
                    search.record(there if method.recheck else here, accepted)
                    gained = min(here.total, there.total) < best.total * (1 - stage.tolerance)
                    quiet = 0 if gained and (accepted or stage.patience) else quiet + 1
                    best = min(best, here, there, key=lambda point: point.total)
                    here = there
                    if quiet > stage.patience:
                        stop = Stop.PATIENCE if stage.patience else Stop.STALLED
                        break
                    if stage.growth < inf and search.pays(here, free, allowance / 2):
                        free = here  # found late: a local estimate may show half of a gain
                    exceeded = grammar.primitives(here.program) > 1.1 * grammar.primitives(free.program) + stage.growth
                    if exceeded:
                        here = best = search.priced(free)
                        break
                if stage.growth == inf:
                    free, allowance = here, stage.price
        except KeyboardInterrupt:
            stop = Stop.INTERRUPTED
        except OutOfTime:
            stop = Stop.TIME
    stop = Stop.INTERRUPTED if search.interrupts.pressed else stop
    best = min(best, search.latest or best, key=lambda point: point.total)
    return Descent(best.program, best.loss, tuple(search.history), stop)


def compatible(trials: Sequence[Trial]) -> list[Rewrite]:
    """Algorithm 2: by descending gain, keep what shares no site with what is kept already."""
    kept: list[Rewrite] = []
    taken: set[int] = set()
    for trial in sorted(trials, key=lambda trial: -trial.gain):
        if trial.gain > 0 and taken.isdisjoint(trial.rewrite.sites):
            kept.append(trial.rewrite)
            taken |= trial.rewrite.sites
    return kept


class OutOfTime(Exception):
    """The run's time is over; never leaves `descend`."""


@dataclass(eq=False)
class Search(Generic[S]):
    """The working parts of `descend`, in the order in which it calls them."""

    grammar: Grammar[S]
    canvas: Canvas
    method: Method
    watch: Callable[[Record, Program[S]], None] | None
    max_seconds: float
    stage: Stage = field(init=False)
    history: list[Record] = field(default_factory=list)
    latest: Point[S] | None = None
    steps: int = 0
    interrupts: Interrupts = field(default_factory=Interrupts)
    started: float = field(default_factory=time.perf_counter)

    bonded: Bonded | None = field(init=False)

    def __post_init__(self) -> None:
        self.bonded = self.grammar if isinstance(self.grammar, Bonded) else None

    def enter(self, stage: Stage) -> None:
        """Take on a stage's edge model and price."""
        self.stage = stage
        self.canvas = self.canvas.with_ramp(stage.ramp)

    def pays(self, point: Point[S], other: Point[S], price: float) -> bool:
        """Whether a point is better than another one at a given price."""
        more = self.grammar.complexity(point.program) - self.grammar.complexity(other.program)
        return point.loss + price * more < other.loss

    def priced(self, point: Point[S]) -> Point[S]:
        """A point of another stage, at this one's price."""
        self.latest = replace(point, total=point.loss + self.stage.price * self.grammar.complexity(point.program))
        return self.latest

    def settle(self, point: Point[S], loss: Loss) -> Point[S]:
        """Gradient steps and repairs in the method's rhythm."""
        stepper = self.method.stepper
        program, state, value = point.program, point.state, inf
        for steps in self.method.rhythm:
            for _ in range(steps):
                self.interrupts.check()
                if time.perf_counter() - self.started > self.max_seconds:
                    raise OutOfTime
                evaluation = self._evaluate(program, loss)
                params, state = stepper.step(program, evaluation, state)
                program = program.moved(params)
                self.steps += 1
                if stepper.settled(state):
                    break
            params, value = stepper.best(program.params, self._strained(program, loss), state)
            program = program.moved(params)
            if self.bonded is not None:
                tight = self.bonded.tightened(program)
                if tight is not program:
                    program, value = tight, self._loss(tight, loss)
            edit = self.grammar.repair(program)
            if edit.program is not program:
                program, state = edit.program, stepper.carry(state, edit)
                value = self._loss(program, loss)
            elif stepper.settled(state):
                break
        self.latest = Point(
            program, state, value, value + self.stage.price * self.grammar.complexity(program), self.steps
        )
        return self.latest

    def promising(self, here: Point[S], loss: Loss, rng: np.random.Generator) -> list[Trial]:
        """The sampled proposals, scored."""
        grammar, method = self.grammar, self.method
        demand = loss.demand(grammar.rasterize(here.program, self.canvas))
        offered = grammar.rewrites(here.program, demand, self.canvas, rng)
        rewrites = sampled([r for r in offered if r.rule not in self.stage.without], method, rng)
        trials = method.estimator.estimate(here.program, rewrites, grammar, loss, self.canvas, self.stage.price)
        return [self.tried(here, trial, loss) for trial in trials]

    def tried(self, here: Point[S], trial: Trial, loss: Loss) -> Trial:
        """The trial; of a rewrite that ties the whole program, what it gains when that has settled."""
        if self.bonded is None or trial.rewrite.rule not in self.bonded.binding:
            return trial
        edit = self.grammar.apply(here.program, [trial.rewrite])
        there = self.settle(Point(edit.program, self.method.stepper.carry(here.state, edit)), loss)
        return Trial(trial.rewrite, here.total - there.total)

    def combine(self, here: Point[S], chosen: Sequence[Rewrite], loss: Loss) -> tuple[Point[S], int]:
        """The program with the chosen rewrites, or with as many of the best as lower the objective together."""
        while chosen:
            edit = self.grammar.apply(here.program, chosen)
            there = Point(edit.program, self.method.stepper.carry(here.state, edit))
            if not self.method.recheck:
                return there, len(chosen)
            there = self.bound(self.settle(there, loss), loss)
            if there.total < here.total:
                return there, len(chosen)
            chosen = chosen[: len(chosen) // 3 or (1 if len(chosen) > 1 else 0)]
        self.latest = here
        return here, 0

    def bound(self, point: Point[S], loss: Loss) -> Point[S]:
        """The point with all bonds of its program that pay, if the stage allows them: a rewrite may have ended some,
        and is to be compared with new ones in their place.
        """
        if self.bonded is None:
            return point
        method = self.method
        for _ in range(BINDINGS):
            offered = [r for r in self.bonded.ties(point.program) if r.rule not in self.stage.without]
            if not offered:
                break
            trials = method.estimator.estimate(
                point.program, offered, self.grammar, loss, self.canvas, self.stage.price
            )
            chosen = compatible(trials)
            if not chosen:
                break
            edit = self.grammar.apply(point.program, chosen)
            there = self.settle(Point(edit.program, method.stepper.carry(point.state, edit)), loss)
            if there.total >= point.total:
                break
            point = there
        return point

    def record(self, point: Point[S], accepted: int) -> None:
        """Write the round down and tell the watcher."""
        seconds = time.perf_counter() - self.started
        entry = Record(self.steps, point.loss, self.grammar.primitives(point.program), accepted, seconds)
        self.history.append(entry)
        if self.watch is not None:
            self.watch(entry, point.program)

    def _evaluate(self, program: Program[S], loss: Loss) -> Evaluation:
        """The loss with the squares of the grammar's bonds, as stiff springs: a step goes along them, not across."""
        evaluation = loss.evaluate(self.grammar.rasterize(program, self.canvas))
        if self.bonded is None:
            return evaluation
        off, jacobian = self.bonded.bonds(program)
        if off.size == 0 or evaluation.curvature is None:
            return evaluation
        stiff = STIFF * self.stage.price
        return Evaluation(
            evaluation.value + stiff * float(off @ off),
            evaluation.gradient + 2 * stiff * (off @ jacobian),
            dense(evaluation.curvature) + 2 * stiff * (jacobian.T @ jacobian),
        )

    def _strained(self, program: Program[S], loss: Loss) -> float:
        """The value that :meth:`_evaluate` gives."""
        value = self._loss(program, loss)
        if self.bonded is not None:
            off, _ = self.bonded.bonds(program)
            value += STIFF * self.stage.price * float(off @ off)
        return value

    def _loss(self, program: Program[S], loss: Loss) -> float:
        return loss.value(self.grammar.rasterize(program, self.canvas))


def sampled(rewrites: Sequence[Rewrite], method: Method, rng: np.random.Generator) -> list[Rewrite]:
    """At most ``method.sample`` rewrites, drawn uniformly without replacement from each rule's share."""
    if method.sample is None:
        return list(rewrites)
    room, chosen = method.sample, []
    reserved = dict(method.reserved)
    rest = [r for r in rewrites if r.rule not in reserved]
    for rule, part in method.reserved:
        pool = [r for r in rewrites if r.rule == rule]
        count = min(len(pool), round(part * method.sample))
        chosen += [pool[i] for i in rng.choice(len(pool), count, replace=False)] if count else []
        room -= round(part * method.sample)
    count = min(len(rest), room)
    chosen += [rest[i] for i in rng.choice(len(rest), count, replace=False)] if count else []
    return chosen
