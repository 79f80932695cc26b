"""Smooth joints, the rewrites that make and free them, and those of corners and whole loops."""

from __future__ import annotations

from math import pi, tan

import numpy as np
import pytest

from d4cad.canvas import AREA, Canvas
from d4cad.estimators import LocalFit
from d4cad.fitting import fit_coverage
from d4cad.grammars.arc_line import ArcLine
from d4cad.grammars.arc_line.joints import JOINTS
from d4cad.grammars.arc_line.structure import Structure
from d4cad.grammars.arc_line.tangency import kinks, smoothed
from d4cad.loop import Loop
from d4cad.objectives.image import ImageLoss
from d4cad.program import Floats, Program, Rewrite
from d4cad.sketch import Sketch

CANVAS = Canvas.square(128, AREA)
GRAMMAR = ArcLine(CANVAS.pixel)
QUARTER = tan(pi / 8)


def rounded(radius: float = 0.3, kind: str = "arc") -> Program[Structure]:
    """A square of half-side 0.8 whose upper right corner is a quarter circle, or a chamfer."""
    points = ((-0.8, -0.8), (0.8, -0.8), (0.8, 0.8 - radius), (0.8 - radius, 0.8), (-0.8, 0.8))
    return GRAMMAR.drawn([Loop(points, (0.0, 0.0, QUARTER if kind == "arc" else 0.0, 0.0, 0.0))])


def raster(program: Program[Structure]) -> Floats:
    return GRAMMAR.rasterize(program, CANVAS).coverage


def applied(program: Program[Structure], rule: str, *data: float) -> Program[Structure]:
    return GRAMMAR.apply(program, [Rewrite(rule, frozenset(), tuple(map(float, data)))]).program


def test_kinks_and_their_derivatives() -> None:
    program = rounded()
    program = program.moved(program.params + np.random.default_rng(0).normal(0, 0.05, program.params.size))
    at = np.arange(5)
    angle, jacobian = kinks(program, at)
    # The boundary turns once: kinks and sweeps together make 2 pi.
    assert angle.sum() + 4 * np.arctan(program.params[-1]) == pytest.approx(2 * pi)
    for k in range(program.params.size):
        high, low = program.params.copy(), program.params.copy()
        high[k] += 1e-6
        low[k] -= 1e-6
        slope = (kinks(program.moved(high), at)[0] - kinks(program.moved(low), at)[0]) / 2e-6
        np.testing.assert_allclose(jacobian[:, k], slope, atol=1e-6)


def test_smoothed_is_smooth_and_near() -> None:
    program = applied(rounded(), "fillet", 2)
    assert program.structure.smooth == (2, 3)
    off = program.moved(program.params + np.random.default_rng(1).normal(0, 0.01, program.params.size))
    found = smoothed(off)
    assert np.abs(kinks(found, np.array([2, 3]))[0]).max() < 1e-11
    assert np.abs(found.params - off.params).max() < 0.05
    assert smoothed(found) is found or np.array_equal(smoothed(found).params, found.params)


def test_joints_that_contradict_each_other_are_left() -> None:
    bowed = GRAMMAR.drawn([Loop(((-0.5, 0.0), (0.5, 0.0), (0.0, 0.01)), (0.0, 0.0, 0.2))])
    tied = Program(Structure(bowed.structure.sizes, bowed.structure.arcs, (0, 2)), bowed.params)
    found = smoothed(tied)
    assert np.isfinite(found.params).all()


@pytest.mark.parametrize(
    ("rule", "site", "smooth", "words"),
    [
        ("smooth", 2, (2,), ["LLaLL"]),
        ("fillet", 2, (2, 3), ["LLalL"]),
        ("straighten", 2, (), ["LLLLL"]),
    ],
)
def test_ties(rule: str, site: int, smooth: tuple[int, ...], words: list[str]) -> None:
    before = rounded()
    after = applied(before, rule, site)
    assert after.structure.smooth == smooth
    assert GRAMMAR.encode(after.structure) == words
    assert GRAMMAR.decode(words) == after.structure
    grown = GRAMMAR.growth(before, Rewrite(rule, frozenset(), (float(site),)))
    assert GRAMMAR.complexity(after) - GRAMMAR.complexity(before) == pytest.approx(grown)


def test_sharpen_takes_smooth_back() -> None:
    before = rounded()
    tied = applied(before, "smooth", 3)
    freed = applied(tied, "sharpen", 3)
    assert freed.structure == before.structure
    np.testing.assert_array_equal(freed.params, before.params)
    assert GRAMMAR.growth(tied, Rewrite("sharpen", frozenset(), (3.0,))) == 0.5


def test_bend_makes_the_fillet_of_a_chamfer_and_straighten_takes_it_back() -> None:
    chamfered = rounded(kind="line")
    offer = next(r for r in GRAMMAR.ties(chamfered) if r.rule == "bend")
    bent = GRAMMAR.apply(chamfered, [offer]).program
    assert bent.structure.smooth == (2, 3)
    np.testing.assert_allclose(raster(bent), raster(rounded()), atol=1e-9)
    growth = GRAMMAR.complexity(bent) - GRAMMAR.complexity(chamfered)
    assert growth == pytest.approx(GRAMMAR.growth(chamfered, offer))
    back = applied(bent, "straighten", 2)
    assert back.structure == chamfered.structure
    np.testing.assert_allclose(raster(back), raster(chamfered), atol=1e-12)


def test_bridge_puts_a_smooth_line_between() -> None:
    slot = GRAMMAR.drawn([Loop(((-0.5, 0.0), (0.5, 0.0)), (0.9, 0.9))])
    after = applied(slot, "bridge", 0)
    assert sorted(after.structure.arcs) == [False, True, True]
    assert len(after.structure.smooth) == 2
    assert np.abs(raster(after) - raster(slot)).sum() < 20
    grown = GRAMMAR.growth(slot, Rewrite("bridge", frozenset(), (0.0,)))
    assert GRAMMAR.complexity(after) - GRAMMAR.complexity(slot) == pytest.approx(grown)


@pytest.mark.parametrize("rule", ["round", "chamfer"])
def test_a_corner_is_cut_and_closed_again(rule: str) -> None:
    square = GRAMMAR.drawn([Loop(((-0.8, -0.8), (0.8, -0.8), (0.8, 0.8), (-0.8, 0.8)), (0.0,) * 4)])
    cut = applied(square, rule, 2)
    assert GRAMMAR.primitives(cut) == 5
    assert sum(cut.structure.arcs) == (rule == "round")
    growth = GRAMMAR.growth(square, Rewrite(rule, frozenset(), (2.0,)))
    assert GRAMMAR.complexity(cut) - GRAMMAR.complexity(square) == growth
    angle, _ = kinks(cut, np.arange(5))
    inserted = 2
    after = int(cut.structure.layout.nxt[inserted])
    if rule == "round":  # tangent to both sides
        assert np.abs(angle[[inserted, after]]).max() < 1e-9
    closed = applied(cut, "close", inserted)
    assert closed.structure == square.structure


def test_an_arc_becomes_three_lines_through_its_thirds() -> None:
    before = rounded()
    after = applied(before, "split-three", 2)
    assert sorted(GRAMMAR.encode(after.structure)) == ["LLLLLLL"]
    middle = np.array([0.5, 0.5])
    radii = np.hypot(*(after.params.reshape(-1, 2) - middle).T)
    assert np.count_nonzero(np.abs(radii - 0.3) < 1e-12) == 4
    growth = GRAMMAR.growth(before, Rewrite("split-three", frozenset(), (2.0,)))
    assert GRAMMAR.complexity(after) - GRAMMAR.complexity(before) == growth


@pytest.mark.parametrize("sign", [1, -1])
def test_a_round_loop_becomes_a_circle(sign: int) -> None:
    angles = sign * np.arange(8) * pi / 4
    points = tuple((0.5 * float(np.cos(a)), 0.1 + 0.5 * float(np.sin(a))) for a in angles)
    octagon = Loop(points, (sign * 0.1,) * 8)
    square = Loop(((-1.2, -1.2), (1.2, -1.2), (1.2, 1.2), (-1.2, 1.2)), (0.0,) * 4)
    program = GRAMMAR.drawn([square, octagon])
    offers = GRAMMAR.rewrites(program, np.zeros(CANVAS.shape), CANVAS, np.random.default_rng(0))
    circles = [r for r in offers if r.rule == "circle"]
    assert [r.data[0] for r in circles] == [4.0]
    after = GRAMMAR.apply(program, circles).program
    assert after.structure.sizes == (4, 2)
    area = Sketch.from_loops([octagon if sign > 0 else octagon.reversed()]).area
    dense = raster(after)
    want = 5.76 if sign > 0 else 5.76 - area  # a loop inside another of its turn adds nothing
    assert dense.sum() * CANVAS.pixel**2 == pytest.approx(want, rel=1e-6)
    growth = GRAMMAR.growth(program, circles[0])
    assert GRAMMAR.complexity(after) - GRAMMAR.complexity(program) == growth


def test_other_rewrites_end_the_joints_that_they_touch_and_no_others() -> None:
    points = ((-0.8, -0.8), (0.8, -0.8), (0.8, 0.5), (0.5, 0.8), (-0.5, 0.8), (-0.8, 0.5))
    program = GRAMMAR.drawn([Loop(points, (0.0, 0.0, QUARTER, 0.0, QUARTER, 0.0))])
    program = applied(applied(program, "fillet", 2), "fillet", 4)
    assert program.structure.smooth == (2, 3, 4, 5)
    after = applied(program, "split", 2)
    assert len(after.structure.smooth) == 2
    np.testing.assert_allclose(kinks(after, after.structure.layout.smooth)[0], 0, atol=1e-12)
    mended = GRAMMAR.repair(program).program
    assert mended.structure.smooth == program.structure.smooth


def test_what_pays_is_foretold() -> None:
    """A fillet off by a little is offered to be smooth, a corner never pays for it."""
    truth = rounded()
    loss = ImageLoss.of(np.round(raster(truth) * 255) / 255)
    rewrites = [r for r in GRAMMAR.ties(truth) if r.rule in JOINTS]
    price = 1e-3 / CANVAS.size
    trials = LocalFit().estimate(truth, rewrites, GRAMMAR, loss, CANVAS, price)
    gains = {(t.rewrite.rule, t.rewrite.data[0]): t.gain / price for t in trials}
    assert gains["smooth", 2.0] == pytest.approx(0.5, abs=0.1)
    assert gains["fillet", 2.0] == pytest.approx(1.0, abs=0.2)
    assert gains.get(("straighten", 2.0), -1.0) < 0


def test_a_tangent_joint_is_found_in_noise() -> None:
    """The place of a tangent joint is nearly invisible; smooth, it is fixed to a fraction of a pixel."""
    truth = rounded(0.6)
    noisy = raster(truth) + np.random.default_rng(0).normal(0, 0.05, CANVAS.shape)
    fit = fit_coverage(np.clip(noisy, 0, 1), CANVAS, init="contour", noise=0.05, floor=60 * 0.05**2, snap=False)
    assert fit.primitives == 5
    assert len(fit.program.structure.smooth) == 2
    found = fit.program.params[:10].reshape(-1, 2) / CANVAS.pixel
    for x, y in truth.params[:10].reshape(-1, 2) / CANVAS.pixel:
        assert np.hypot(*(found - (x, y)).T).min() < 0.6
