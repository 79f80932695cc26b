"""Algorithms 1 and 2: the one loop, its records, its ends, and what it recovers."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from math import inf

import numpy as np
import pytest

from d4cad.bench import coverage
from d4cad.canvas import AREA, Canvas
from d4cad.descent import Descent, Method, Point, Record, Search, Stage, Stop, compatible, descend, sampled
from d4cad.estimators import LocalFit, Stepped
from d4cad.fitting import fit_coverage
from d4cad.grammars.arc_line import ArcLine, Structure
from d4cad.interrupts import postponed
from d4cad.methods import fast
from d4cad.objectives.image import ImageLoss
from d4cad.program import Floats, Program, Rewrite
from d4cad.protocols import Trial
from d4cad.registry import make_grammar, make_method
from d4cad.shapes import generate
from d4cad.sketch import Loop, Sketch
from d4cad.steppers import ClippedGradient, LevenbergMarquardt

CANVAS = Canvas.square(64)
GRAMMAR = ArcLine(CANVAS.pixel)
Watch = Callable[[Record, Program[Structure]], None]


def target(primitives: int = 8, seed: int = 3, canvas: Canvas = CANVAS) -> Floats:
    return coverage(generate(np.random.default_rng(seed), primitives), canvas)


def square(half: float = 0.7) -> Sketch:
    return Sketch.from_loops([Loop.polyline([(-half, -half), (half, -half), (half, half), (-half, half)])])


def search(picture: Floats, method: Method, watch: Watch | None = None, **limits: float) -> Descent[Structure]:
    rng = np.random.default_rng(0)
    return descend(GRAMMAR.axiom(CANVAS), GRAMMAR, ImageLoss.of(picture), CANVAS, method, rng, watch, **limits)


def paper_search(seed: int, picture: Floats, rounds: int = 4) -> Descent[Structure]:
    method = make_method("paper", CANVAS, 0.0)
    method = replace(method, stages=(replace(method.stages[0], rounds=rounds),))
    grammar = make_grammar("arc-line", "paper", CANVAS)
    rng = np.random.default_rng(seed)
    return descend(grammar.axiom(CANVAS), grammar, ImageLoss.of(picture), CANVAS, method, rng)


def trial(gain: float, *sites: int) -> Trial:
    return Trial(Rewrite("split", frozenset(sites)), gain)


@pytest.mark.parametrize(
    ("trials", "kept"),
    [
        ([], []),
        ([trial(1, 0), trial(2, 1)], [1, 0]),
        ([trial(1, 0, 1), trial(2, 1, 2), trial(0.5, 3)], [1, 2]),
        ([trial(3, 0), trial(2, 0, 1), trial(1, 1)], [0, 2]),
        ([trial(0, 0), trial(-1, 1)], []),
        ([trial(1), trial(2)], [1, 0]),  # new loops touch nothing
    ],
)
def test_compatible_keeps_the_best_that_share_no_site(trials: list[Trial], kept: list[int]) -> None:
    assert compatible(trials) == [trials[k].rewrite for k in kept]


def test_a_sample_keeps_the_reserved_share() -> None:
    rewrites = [Rewrite(rule, frozenset()) for rule in ["split"] * 100 + ["add-loop"] * 40]
    method = replace(fast(CANVAS), sample=64, reserved=(("add-loop", 0.25),))
    rules = [r.rule for r in sampled(rewrites, method, np.random.default_rng(0))]
    assert (rules.count("split"), rules.count("add-loop")) == (48, 16)
    few = sampled(rewrites[90:103], method, np.random.default_rng(0))
    assert {id(r) for r in few} == {id(r) for r in rewrites[90:103]}
    assert sampled(rewrites, replace(method, sample=None), np.random.default_rng(0)) == rewrites


def test_a_rewrite_is_credited_against_the_base_after_the_same_steps() -> None:
    """A line turned into an arc of bulge 0 is the same shape: its gain is what the base's own steps cannot do."""
    loss, stepper = ImageLoss.of(coverage(square(), CANVAS)), ClippedGradient()
    base = GRAMMAR.axiom(CANVAS)
    rewrite = Rewrite("to-arc", frozenset((0, 1)), (0.0,))
    still, stepped = (
        Stepped(stepper, steps).estimate(base, [rewrite], GRAMMAR, loss, CANVAS, 0.0)[0].gain for steps in (0, 1)
    )

    def after_one_step(program: Program[Structure]) -> float:
        moved, _ = stepper.step(program, loss.evaluate(GRAMMAR.rasterize(program, CANVAS)), stepper.init(program))
        return loss.value(GRAMMAR.rasterize(program.moved(moved), CANVAS))

    assert still == pytest.approx(0, abs=1e-15)
    rewritten = GRAMMAR.apply(base, [rewrite]).program
    assert stepped == pytest.approx(after_one_step(base) - after_one_step(rewritten), rel=1e-12)
    assert stepped < loss.value(GRAMMAR.rasterize(base, CANVAS)) - after_one_step(rewritten)


def test_a_set_that_harms_together_is_cut_down_to_what_helps() -> None:
    loss = ImageLoss.of(coverage(square(), CANVAS))
    method = fast(CANVAS)
    found = Search(GRAMMAR, CANVAS, method, None, inf)
    found.enter(method.stages[-1])
    start = GRAMMAR.axiom(CANVAS)
    here = found.settle(Point(start, method.stepper.init(start)), loss)
    useful = compatible(found.promising(here, loss, np.random.default_rng(0)))[:1]
    harmful = [Rewrite("add-loop", frozenset(), (0.0, x, 1.3, 0.2)) for x in (-1.2, 1.2)]
    found.enter(replace(method.stages[-1], price=1.0))  # at this price no edge pays, whatever it gains
    here = replace(here, total=here.loss + GRAMMAR.complexity(here.program))
    assert found.combine(here, [*useful, *harmful], loss) == (here, 0)
    found.enter(replace(method.stages[-1], price=1e-9))
    here = replace(here, total=here.loss + 1e-9 * GRAMMAR.complexity(here.program))
    there, accepted = found.combine(here, useful, loss)
    assert accepted == 1
    assert there.total < here.total


def test_stops_when_nothing_pays() -> None:
    found = search(coverage(square(), CANVAS), fast(CANVAS))
    assert found.stop is Stop.STALLED
    assert found.loss < 1e-15
    assert GRAMMAR.primitives(found.program) == 4


def test_stops_for_want_of_progress() -> None:
    method = make_method("paper", CANVAS, 0.0)
    method = replace(method, stages=(replace(method.stages[0], patience=2, tolerance=0.9),))
    assert search(target(), method).stop is Stop.PATIENCE


def test_stops_after_the_rounds() -> None:
    found = paper_search(0, target(), rounds=3)
    assert found.stop is Stop.ROUNDS
    assert len(found.history) == 3


def test_stops_at_the_time_limit() -> None:
    assert search(target(), fast(CANVAS), max_seconds=0.0).stop is Stop.TIME


def test_ctrl_c_waits_for_a_moment_between_steps() -> None:
    """Wherever the signal comes, the run ends in order; afterwards Python's own handler is back."""

    def press(record: Record, program: Program[Structure]) -> None:
        if record.step:
            signal.raise_signal(signal.SIGINT)

    found = search(target(), fast(CANVAS), press)
    assert found.stop is Stop.INTERRUPTED
    assert len(found.history) == 1
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with postponed() as interrupts:
        signal.raise_signal(signal.SIGINT)
        assert interrupts.pressed
        with pytest.raises(KeyboardInterrupt):
            interrupts.check()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_an_interrupt_keeps_the_best_so_far() -> None:
    def interrupt(record: Record, program: Program[Structure]) -> None:
        if record.accepted and record.loss < 0.02:
            raise KeyboardInterrupt

    found = search(target(), fast(CANVAS), interrupt)
    assert found.stop is Stop.INTERRUPTED
    assert found.loss < 0.02


def test_returns_the_best_and_not_the_last() -> None:
    """Uphill every round is worse than the one before; what is returned is the first."""
    stepper = ClippedGradient(rate=-0.5, least=-0.5)
    stage = Stage(ramp=CANVAS.ramp, price=1e-5, rounds=5, patience=99)
    found = search(target(), Method((stage,), (3,), stepper, Stepped(stepper, 0), 0, recheck=False))
    assert found.loss == found.history[0].loss
    assert found.history[-1].loss > found.loss


def test_history_tells_steps_and_time_in_order() -> None:
    found = search(target(), fast(CANVAS))
    order = [(record.step, record.seconds) for record in found.history]
    assert order == sorted(order)
    assert found.history[-1].primitives == GRAMMAR.primitives(found.program)
    assert found.history[-1].psnr > found.history[0].psnr
    assert any(record.accepted for record in found.history)


def test_same_seed_same_result_bit_for_bit() -> None:
    picture = target()
    one, two, other = paper_search(1, picture), paper_search(1, picture), paper_search(2, picture)
    assert one.program.params.tobytes() == two.program.params.tobytes()
    assert one.program.params.tobytes() != other.program.params.tobytes()


DIGEST = """
import hashlib, numpy as np
from d4cad.bench import coverage
from d4cad.canvas import AREA, Canvas
from d4cad.descent import descend
from d4cad.grammars.arc_line import ArcLine
from d4cad.fitting import fit_coverage
from d4cad.interrupts import postponed
from d4cad.methods import fast
from d4cad.objectives.image import ImageLoss
from d4cad.shapes import generate
canvas = Canvas.square(64)
grammar = ArcLine(canvas.pixel)
picture = coverage(generate(np.random.default_rng(3), 8), canvas)
found = descend(grammar.axiom(canvas), grammar, ImageLoss.of(picture), canvas, fast(canvas), np.random.default_rng(0))
print(hashlib.sha256(found.program.params.tobytes()).hexdigest())
"""


def test_two_processes_agree_bit_for_bit() -> None:
    command = [sys.executable, "-c", DIGEST]
    first, second = (subprocess.run(command, capture_output=True, text=True, check=True).stdout for _ in range(2))
    assert first == second != ""


def test_goes_on_from_any_program() -> None:
    picture = target()
    first = search(picture, fast(CANVAS))
    rng = np.random.default_rng(0)
    again = descend(first.program, GRAMMAR, ImageLoss.of(picture), CANVAS, fast(CANVAS), rng)
    assert again.loss <= first.loss + 1e-12
    assert GRAMMAR.primitives(again.program) <= GRAMMAR.primitives(first.program)


def test_local_and_stepped_estimates_serve_the_same_loop() -> None:
    stepper = LevenbergMarquardt()
    stage = Stage(ramp=CANVAS.ramp, price=1e-6, rounds=4)
    for estimator in (LocalFit(2), Stepped(stepper, 2)):
        found = search(coverage(square(), CANVAS), Method((stage,), (8,), stepper, estimator, 24))
        assert found.history[-1].loss < found.history[0].loss or found.loss < 1e-6


def test_generated_shapes_come_back_exactly() -> None:
    """The distribution over seeds, not one run."""
    canvas = Canvas.square(256)
    grammar = ArcLine(canvas.pixel)
    exact = 0
    for seed in range(20):
        sketch = generate(np.random.default_rng(1000 + seed), 8)
        loss = ImageLoss.of(coverage(sketch, canvas))
        rng = np.random.default_rng(0)
        found = descend(grammar.axiom(canvas), grammar, loss, canvas, fast(canvas), rng)
        exact += found.loss < 1e-8 and grammar.primitives(found.program) <= sketch.primitives
    assert exact >= 19


@pytest.mark.parametrize(("growth", "fell_back"), [(100.0, False), (-100.0, True)])
def test_a_fallback_is_for_a_search_that_went_back(growth: float, fell_back: bool) -> None:
    stage = Stage(CANVAS.ramp, price=1e-4, rounds=3)
    marked = Stage(CANVAS.ramp, price=1.0, rounds=1, fallback=True)
    limited = Method((stage, replace(stage, growth=growth)), (8,), LevenbergMarquardt(), LocalFit(2))
    without, with_it = (
        search(target(), method) for method in (limited, replace(limited, stages=(*limited.stages, marked)))
    )
    assert (len(with_it.history) > len(without.history)) == fell_back


def test_what_arcs_only_come_near_to_takes_few_of_them() -> None:
    canvas = Canvas.square(128, AREA)
    turns = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    ellipse = Sketch.from_loops([Loop.polyline([(1.2 * np.cos(t), 0.7 * np.sin(t)) for t in turns])])
    fit = fit_coverage(coverage(ellipse, canvas), canvas, init="contour", floor=1e-4)
    assert fit.outline.primitives <= 10
    assert fit.psnr > 45


def test_late_growth_counts_only_if_it_would_not_have_paid() -> None:
    here, there = (Point(GRAMMAR.axiom(CANVAS), None, loss) for loss in (0.1, 0.2))
    found = Search(GRAMMAR, CANVAS, fast(CANVAS), None, inf)
    assert found.pays(here, there, 1.0)
    assert not found.pays(there, here, 1.0)
    edit = GRAMMAR.apply(here.program, [Rewrite("split-lines", frozenset((0, 1)), (0.0, 0.5))])
    more = GRAMMAR.complexity(edit.program) - GRAMMAR.complexity(here.program)
    assert more > 0
    assert found.pays(Point(edit.program, None, 0.1), there, 0.09 / more)
    assert not found.pays(Point(edit.program, None, 0.1), there, 0.11 / more)
