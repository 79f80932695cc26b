"""From a prompt to a part: score distillation over shape programs, several candidates, ranked."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import ceil, inf, isfinite
from os import PathLike
from typing import Any

import numpy as np

from d4cad.canvas import PAPER_RAMP, Canvas
from d4cad.descent import Descent, Method, Record, Stage, Stop, descend
from d4cad.errors import InputError
from d4cad.estimators import Linearised, LocalFit
from d4cad.fit import Fit, decibels, joined_outline
from d4cad.objectives.distillation import Denoiser, Distillation, DistillationLoss, Wish
from d4cad.objectives.views import PAPER, PLAIN, Views
from d4cad.placement import Placement
from d4cad.priors.choice import chosen
from d4cad.program import Program
from d4cad.programs import load_program
from d4cad.protocols import Bonded, Grammar
from d4cad.registry import entry, make_grammar
from d4cad.steppers import Adam, LevenbergMarquardt


@dataclass(frozen=True, slots=True)
class Habit:
    """How a grammar is searched. price: the loss that a primitive may cost. most: primitives. rate: Adam's."""

    price: float
    most: int
    rate: float = 0.01


HABITS: Mapping[str, Habit] = {
    "arc-line": Habit(2e-4, 60),
    "union-rect": Habit(1e-3, 25),
    "tree": Habit(4e-4, 200),
}

BLOCK = 5
"""Gradient steps between rewrites."""

POLISH = 12
"""Most rounds of Levenberg-Marquardt steps when the shape is decided."""

WIDTH = 50.0
"""Width of a part in mm, if no size is asked for."""

LAST = 0.05
"""The time at which a search ends."""

COARSE, SIDE = 64, 128
"""Least and most pixels along the canvas; pictures of other sizes are interpolated from it."""

JUDGED = (0.3, 0.45, 0.6, 0.75)
"""Times at which candidates are compared, each with two noises that all of them share."""

Watch = Callable[[Record, Fit], None]


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """One design. seed: that gives it again. score: how far it is from what the prior sees in it, less is better."""

    fit: Fit
    seed: int
    score: float


def fit_text(
    prompt: str,
    *,
    grammar: str = "arc-line",
    prior: str | Denoiser = "embedded",
    steps: int = 200,
    seed: int = 0,
    candidates: int = 1,
    negative: str = "",
    guidance: float | None = None,
    weighting: str = "x0",
    augment: bool | None = None,
    init: str | PathLike[str] | Fit | None = None,
    device: str = "cpu",
    dtype: str | None = None,
    max_time: float | None = None,
    watch: Watch | None = None,
) -> list[Candidate]:
    """Shapes that a prior takes for what a prompt says, the best first.

    grammar: of :mod:`d4cad.registry`. prior: a name as :func:`d4cad.priors.choice.chosen` has it, or a denoiser. steps:
    gradient steps of each candidate. seed: of the first; the others count up. guidance: None for 7, or 100 for Stable
    Diffusion as in the paper. weighting: "x0", "sds" or "snr". augment: random perspective and crops; None for
    Stable Diffusion only. init: a program file or fit to go on from. device, dtype: for torch. max_time: seconds
    for all. watch: called with a Record and the shape so far after every round. Raises InputError for what cannot be
    used. Ctrl-C ends the search; what is there so far is returned.
    """
    _check(grammar, steps, seed, candidates, max_time)
    start = load_program(init) if init is not None and not isinstance(init, Fit) else init
    if start is not None and start.grammar.name != grammar:
        raise InputError(f"the program to start from is in the grammar {start.grammar.name}, expected {grammar}")
    latent = isinstance(prior, str) and prior.startswith("sd:")
    wish = Wish(prompt, negative, (100.0 if latent else 7.0) if guidance is None else guidance, weighting)
    pick = chosen(prior, prompt, negative, device, dtype) if isinstance(prior, str) else lambda number: prior
    views = PAPER if (latent if augment is None else augment) else PLAIN
    deadline = inf if max_time is None else time.perf_counter() + max_time
    settings = {
        "prompt": prompt, "prior": prior if isinstance(prior, str) else type(prior).__name__, "steps": steps,
        "negative": negative, "guidance": wish.guidance, "weighting": weighting, "max_time": max_time,
    }  # fmt: skip
    found: list[Candidate] = []
    for number in range(candidates):
        left = deadline - time.perf_counter()
        if found and left <= 0:
            break
        search = _Search.of(pick(seed + number), wish, grammar, views, seed + number, settings, watch)
        fit = search.run(steps, start, left / (candidates - number))
        found.append(Candidate(fit, seed + number, search.score(fit)))
        if fit.stop is Stop.INTERRUPTED:
            break
    return sorted(found, key=lambda candidate: candidate.score)


def _check(grammar: str, steps: int, seed: int, candidates: int, max_time: float | None) -> None:
    entry(grammar)
    if grammar not in HABITS:
        raise InputError(f"parts from words are searched in one of {', '.join(HABITS)}, got {grammar!r}")
    for name, value, least in (("steps", steps, 1), ("seed", seed, 0), ("candidates", candidates, 1)):
        if value < least:
            raise InputError(f"the {name} must be {least} or more, got {value}")
    if max_time is not None and not (isfinite(max_time) and max_time > 0):
        raise InputError(f"the time limit must be a positive number, got {max_time:g}")


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """The working parts of :func:`fit_text` for one candidate."""

    denoiser: Denoiser
    wish: Wish
    views: Views
    canvas: Canvas
    grammar: Grammar[Any]
    habit: Habit
    seed: int
    settings: Mapping[str, Any]
    watch: Watch | None
    history: list[Record]

    @classmethod
    def of(
        cls, denoiser: Denoiser, wish: Wish, grammar: str, views: Views, seed: int, settings: Mapping[str, Any],
        watch: Watch | None,
    ) -> _Search:  # fmt: skip
        canvas = Canvas.square(min(max(denoiser.size, COARSE), SIDE), PAPER_RAMP)
        language = make_grammar(grammar, "fast", canvas)
        return cls(denoiser, wish, views, canvas, language, HABITS[grammar], seed, settings, watch, [])

    def run(self, steps: int, start: Fit | None, seconds: float) -> Fit:
        """The descent from an axiom or a fit: annealed by Adam's steps, polished, and cut down to the most primitives
        allowed."""
        rng = np.random.default_rng(self.seed)
        cpu, wall = time.process_time(), time.perf_counter()
        rounds = max(1, ceil(steps / BLOCK))
        # a shape to go on from is not to be forgotten in noise
        times = (0.98 if start is None else 0.5, LAST)
        objective = Distillation(self.denoiser, self.wish, times, rounds, views=self.views)
        first = self.grammar.axiom(self.canvas) if start is None else start.program
        found = self._annealed(first, objective, rng, seconds)
        price = self.habit.price
        while found.stop not in (Stop.INTERRUPTED, Stop.TIME):
            left = max(seconds - (time.perf_counter() - wall), 0.0)
            found = self._polished(found.program, price, rng, left)
            price *= 2
            if self.grammar.primitives(found.program) <= self.habit.most or price > 1000 * self.habit.price:
                break
        fit = self.fit(found.program, found.stop)
        return replace(fit, seconds=time.process_time() - cpu, wall=time.perf_counter() - wall)

    def _annealed(
        self, program: Program[Any], objective: Distillation, rng: np.random.Generator, seconds: float
    ) -> Descent[Any]:
        """The program after all draws of an objective. Smooth joints can wait until the shape is decided."""
        binding = self.grammar.binding if isinstance(self.grammar, Bonded) else frozenset()
        rounds = objective.rounds
        stage = Stage(self.canvas.ramp, self.habit.price, rounds, patience=rounds, without=frozenset(binding))
        method = Method((stage,), (BLOCK,), Adam(self.habit.rate), Linearised(LocalFit(4)))
        return descend(program, self.grammar, objective, self.canvas, method, rng, self._note(), seconds)

    def _polished(self, program: Program[Any], price: float, rng: np.random.Generator, seconds: float) -> Descent[Any]:
        """The program fitted to what the prior makes of it at the last time."""
        pull = self.last().pull(self.grammar.rasterize(program, self.canvas).coverage)
        stage = Stage(self.canvas.ramp, price / pull.scale, POLISH)
        method = Method((stage,), (8, 4), LevenbergMarquardt(), LocalFit(4))
        return descend(program, self.grammar, pull.near, self.canvas, method, rng, self._note(pull.scale), seconds)

    def _note(self, scale: float = 1.0) -> Callable[[Record, Program[Any]], None]:
        """What writes records down that go on from the last one, their loss times ``scale``, and tells the watcher."""
        before = self.history[-1] if self.history else Record(0, 0.0, 0, 0, 0.0)

        def note(record: Record, now: Program[Any]) -> None:
            step, seconds = before.step + record.step, before.seconds + record.seconds
            self.history.append(replace(record, step=step, loss=record.loss * scale, seconds=seconds))
            if self.watch is not None:
                self.watch(self.history[-1], self.fit(now, Stop.ROUNDS))

        return note

    def last(self) -> DistillationLoss:
        """The loss of the last time: straight on, and unguided: guidance overshoots where little is left to decide."""
        wish = replace(self.wish, guidance=1.0, weighting="x0")
        return Distillation(self.denoiser, wish, (LAST, LAST), 1).draw(np.random.default_rng(self.seed))

    def fit(self, program: Program[Any], stop: Stop) -> Fit:
        """The program as a fit whose target is what the prior makes of it at the last time."""
        coverage = self.grammar.rasterize(program, self.canvas).coverage
        target = np.clip(self.last().pull(coverage).near.table.target, 0, 1)
        error = float(np.mean((coverage - target) ** 2))
        return Fit(
            program=program,
            canvas=self.canvas,
            grammar=self.grammar,
            psnr=decibels(error),
            outline=joined_outline(self.grammar, program, self.canvas, error),
            history=tuple(self.history),
            stop=stop,
            seconds=0.0,
            wall=0.0,
            settings={"picture": self.wish.prompt, "seed": self.seed, **self.settings},
            made=Placement(width=WIDTH),
            target=target,
        )

    def score(self, fit: Fit) -> float:
        """The mean loss, unguided, at fixed times and noises."""
        wish = replace(self.wish, guidance=1.0, weighting="x0")
        rng = np.random.default_rng(0)
        coverage = fit.coverage
        losses = [Distillation(self.denoiser, wish, (at, at), 1).draw(rng) for at in JUDGED for _ in range(2)]
        return float(np.mean([loss.pull(coverage).value for loss in losses]))
