"""Facts of the Arc-Line grammar's rewrites: effect, inverse, jump, guard, and what a trial foretells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import pi, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from d4cad.canvas import Canvas
from d4cad.errors import GrammarError
from d4cad.estimators import LocalFit
from d4cad.grammars.arc_line import ArcLine, Structure
from d4cad.objectives.image import ImageLoss
from d4cad.program import Floats, Program, Rewrite
from d4cad.shapes import generate

Loops = Sequence[Sequence[tuple[float, float, float | None]]]
CANVAS = Canvas.square(128)
GRAMMAR = ArcLine(CANVAS.pixel, lossy=24.0)
QUARTER = tan(pi / 8)


def program(*loops: Sequence[tuple[float, float, float | None]]) -> Program[Structure]:
    """Loops of vertices (x, y, bulge of the edge from there, None for a line), world units."""
    flat = [vertex for loop in loops for vertex in loop]
    arcs = tuple(b is not None for _, _, b in flat)
    numbers = [value for x, y, _ in flat for value in (x, y)] + [b for _, _, b in flat if b is not None]
    return Program(Structure(tuple(map(len, loops)), arcs), np.array(numbers, dtype=np.float64))


SQUARE = [(-0.8, -0.8, None), (0.8, -0.8, None), (0.8, 0.8, None), (-0.8, 0.8, None)]
FIVE = [*SQUARE[:1], (0.1, -0.8, None), *SQUARE[1:]]
ROUND = [(0.0, -0.7, QUARTER), (0.7, 0.0, QUARTER), (0.0, 0.7, QUARTER), (-0.7, 0.0, QUARTER)]
DISH = [(-0.8, -0.5, 0.3), (0.8, -0.5, None), (0.8, 0.6, None), (-0.8, 0.6, None)]
LENS = [(-0.7, 0.0, 0.5), (0.7, 0.0, 0.7)]
HOLE = [(-0.3, -0.2, None), (-0.3, 0.2, None), (0.3, 0.2, None), (0.3, -0.2, None)]
SPIKE = [*SQUARE[:2], (0.8, 0.1, None), (1.2, 0.1, None), (0.8, 0.1, None), *SQUARE[2:]]


def offered(found: Program[Structure], rule: str, grammar: ArcLine = GRAMMAR) -> list[Rewrite]:
    nothing = np.zeros(CANVAS.shape)
    rewrites = grammar.rewrites(found, nothing, CANVAS, np.random.default_rng(0))
    return [rewrite for rewrite in rewrites if rewrite.rule == rule]


def at(found: Program[Structure], rule: str, site: int) -> Rewrite:
    return next(rewrite for rewrite in offered(found, rule) if rewrite.data[0] == site)


def raster(found: Program[Structure]) -> Floats:
    return GRAMMAR.rasterize(found, CANVAS).coverage


def words(found: Program[Structure]) -> list[str]:
    encoded: list[str] = GRAMMAR.encode(found.structure)
    return encoded


# rule, loops, site -> kinds afterwards
@pytest.mark.parametrize(
    ("rule", "loops", "site", "after"),
    [
        ("split", [SQUARE], 1, ["LLLLL"]),
        ("split", [DISH], 0, ["AALLL"]),
        ("split-lines", [DISH], 0, ["LLLLL"]),
        ("to-arc", [SQUARE], 2, ["LLAL"]),
        ("to-line", [DISH], 0, ["LLLL"]),
        ("merge-line", [FIVE], 1, ["LLLL"]),
        ("merge-arc", [FIVE], 1, ["ALLL"]),
        ("merge-arc", [ROUND], 1, ["AAA"]),
        ("merge-line", [SPIKE], 3, ["LLLLLL"]),
        ("remove-loop", [SQUARE, HOLE], 4, ["LLLL"]),
        ("remove-loop", [SQUARE, HOLE], 0, ["LLLL"]),
    ],
)
def test_effect(rule: str, loops: Loops, site: int, after: list[str]) -> None:
    before = program(*loops)
    rewrite = at(before, rule, site)
    found = GRAMMAR.apply(before, [rewrite]).program
    assert words(found) == after
    assert GRAMMAR.complexity(found) - GRAMMAR.complexity(before) == pytest.approx(GRAMMAR.growth(before, rewrite))


@pytest.mark.parametrize("loops", [[SQUARE], [ROUND], [DISH], [SQUARE, HOLE], [LENS]])
@pytest.mark.parametrize("rule", ["split", "to-arc"])
def test_split_and_to_arc_do_not_jump(rule: str, loops: Loops) -> None:
    before = program(*loops)
    for rewrite in offered(before, rule):
        after = GRAMMAR.apply(before, [rewrite]).program
        assert np.abs(raster(after) - raster(before)).max() < 1e-9


@pytest.mark.parametrize(
    ("loops", "there", "back"),
    [
        ([SQUARE], ("split", 0), ("merge-line", 1)),
        ([DISH], ("split", 0), ("merge-arc", 1)),
        ([SQUARE], ("to-arc", 3), ("to-line", 3)),
    ],
)
def test_inverse(loops: Loops, there: tuple[str, int], back: tuple[str, int]) -> None:
    before = program(*loops)
    middle = GRAMMAR.apply(before, [at(before, *there)]).program
    after = GRAMMAR.apply(middle, [at(middle, *back)]).program
    assert words(after) == words(before)
    assert after.params == pytest.approx(before.params, abs=1e-12)


def test_a_new_loop_and_its_removal_are_inverse() -> None:
    before = program(SQUARE)
    hole = Rewrite("add-loop", frozenset(), (0.0, 0.1, 0.2, -0.3))
    middle = GRAMMAR.apply(before, [hole]).program
    assert words(middle) == ["LLLL", "AAAA"]
    area = (raster(before) - raster(middle)).sum() * CANVAS.pixel**2
    assert area == pytest.approx(pi * 0.09, rel=5e-3)
    after = GRAMMAR.apply(middle, [at(middle, "remove-loop", 4)]).program
    assert after.params == pytest.approx(before.params, abs=1e-12)


def test_close_lets_the_neighbours_meet_in_the_middle() -> None:
    chamfered = program([*SQUARE[:2], (0.8, 0.7, None), (0.7, 0.8, None), SQUARE[3]])
    after = GRAMMAR.apply(chamfered, [at(chamfered, "close", 2)]).program
    assert words(after) == ["LLLL"]
    assert after.params[4:6] == pytest.approx([0.75, 0.75])


@pytest.mark.parametrize("deep", [0.6, 1.6])
def test_pinch_takes_out_a_slit(deep: float) -> None:
    """A slit from the rim to a hole, its sides together: what stays is the square and the hole."""
    slit = [(0.8, 0.05, None), (0.8 - deep / 2, 0.05, None)]
    inside = [(0.2 - deep / 4, 0.4, None), (-0.4, 0.0, None), (0.2 - deep / 4, -0.4, None)]
    back = [(0.8 - deep / 2, 0.049, None), (0.8, 0.049, None)]
    before = program([SQUARE[0], SQUARE[1], *back[::-1], *inside[::-1], *slit[::-1], SQUARE[2], SQUARE[3]])
    rewrite = offered(before, "pinch")[0]
    after = GRAMMAR.apply(before, [rewrite]).program
    assert sorted(len(word) for word in words(after)) == [4, 5]
    assert GRAMMAR.growth(before, rewrite) == -2.0
    assert np.abs(raster(after) - raster(before)).mean() < 2e-3


@pytest.mark.parametrize(
    ("rule", "loops", "grammar"),
    [
        ("merge-line", [LENS], GRAMMAR),
        ("merge-arc", [LENS], GRAMMAR),
        ("close", [LENS], GRAMMAR),
        ("remove-loop", [SQUARE], GRAMMAR),
        ("to-line", [SQUARE], GRAMMAR),
        ("to-arc", [ROUND], GRAMMAR),
        ("split-lines", [SQUARE], GRAMMAR),
        ("to-line", [DISH], ArcLine(CANVAS.pixel, lossy=2.0)),
        ("merge-line", [SQUARE], ArcLine(CANVAS.pixel, lossy=2.0)),
        ("close", [SQUARE], ArcLine(CANVAS.pixel, lossy=2.0)),
        ("pinch", [SQUARE, HOLE], GRAMMAR),
        ("split", [SQUARE], ArcLine(CANVAS.pixel, rules=frozenset({"to-arc"}))),
    ],
)
def test_guard_refuses(rule: str, loops: Loops, grammar: ArcLine) -> None:
    assert offered(program(*loops), rule, grammar) == []


def test_a_merged_line_stays_within_the_guard() -> None:
    grammar = ArcLine(CANVAS.pixel, lossy=3.0)
    for height in (0.02, 0.05, 0.1, 0.2):
        bent = program([SQUARE[0], (0.0, -0.8 - height, None), *SQUARE[1:]])
        allowed = [r for r in offered(bent, "merge-line", grammar) if r.data[0] == 1]
        assert bool(allowed) == (height / CANVAS.pixel <= 3.0)


def test_a_compatible_set_is_applied_as_one_by_one() -> None:
    before = program(SQUARE, HOLE)
    together = GRAMMAR.apply(before, [at(before, "split", 0), at(before, "to-arc", 2), at(before, "split", 5)]).program
    alone = GRAMMAR.apply(before, [at(before, "split", 5)]).program
    alone = GRAMMAR.apply(alone, [at(alone, "to-arc", 2)]).program
    alone = GRAMMAR.apply(alone, [at(alone, "split", 0)]).program
    assert together.structure == alone.structure
    assert together.params == pytest.approx(alone.params, abs=1e-12)


@given(seed=st.integers(0, 200), rule=st.sampled_from(["split", "to-arc", "merge-arc", "close", "to-line"]))
@settings(max_examples=40, deadline=None)
def test_origin_says_which_parameters_go_on(seed: int, rule: str) -> None:
    sketch = generate(np.random.default_rng(seed), 8)
    before = program(*[
        [(x, y, b or None) for (x, y), b in zip(loop.points, loop.bulges, strict=True)] for loop in sketch.loops
    ])  # fmt: skip
    for rewrite in offered(before, rule)[:6]:
        edit = GRAMMAR.apply(before, [rewrite])
        assert edit.origin.shape == edit.program.params.shape
        assert edit.origin.max() < before.params.size
        kept = edit.origin >= 0
        old, new = before.params[edit.origin[kept]], edit.program.params[kept]
        if rule != "close":
            assert new == pytest.approx(old, abs=1e-12)
        assert np.unique(edit.origin[kept]).size == kept.sum()


@given(seed=st.integers(0, 200))
@settings(max_examples=15, deadline=None)
def test_a_trial_foretells_what_its_rewrite_gains(seed: int) -> None:
    """The gain is the decrease of the loss, less the price, when the rewrite is applied with the values it found."""
    rng = np.random.default_rng(seed)
    sketch = generate(rng, 8)
    truth = program(*[
        [(x, y, b or None) for (x, y), b in zip(loop.points, loop.bulges, strict=True)] for loop in sketch.loops
    ])  # fmt: skip
    loss = ImageLoss.of(raster(truth))
    base = truth.moved(truth.params + rng.normal(0, 0.004, truth.params.size))
    here, price = loss.value(GRAMMAR.rasterize(base, CANVAS)), 1e-7
    rewrites = GRAMMAR.rewrites(base, np.zeros(CANVAS.shape), CANVAS, rng)
    trials = LocalFit(3).estimate(base, rewrites, GRAMMAR, loss, CANVAS, price)
    for trial in sorted(trials, key=lambda trial: -trial.gain)[:8]:
        after = GRAMMAR.apply(base, [trial.rewrite]).program
        gained = here - loss.value(GRAMMAR.rasterize(after, CANVAS)) - price * GRAMMAR.growth(base, trial.rewrite)
        if _moves_only_its_own(base, trial.rewrite):
            assert trial.gain == pytest.approx(gained, rel=1e-6, abs=1e-10)


def _moves_only_its_own(base: Program[Structure], rewrite: Rewrite) -> bool:
    """Whether the trial had no bulge beside the rewrite to tune, which `apply` leaves as it was."""
    nxt, prv = base.structure.layout.nxt, base.structure.layout.prv
    beside = {int(k) for site in rewrite.sites for k in (prv[site], nxt[site], site)}
    return not any(base.structure.arcs[k] for k in beside)


def test_words_of_a_structure_there_and_back() -> None:
    structure = program(DISH, LENS).structure
    assert GRAMMAR.encode(structure) == ["ALLL", "AA"]
    assert GRAMMAR.decode(["ALLL", "AA"]) == structure


@pytest.mark.parametrize("value", [None, [], "LL", ["LX"], [3], [["L"]], ["L"]])
def test_other_words_are_refused(value: object) -> None:
    with pytest.raises(GrammarError):
        GRAMMAR.decode(value)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_parameters_that_are_not_finite_are_refused(wrong: float) -> None:
    before = program(SQUARE)
    with pytest.raises(GrammarError, match="finite"):
        GRAMMAR.repair(before.moved(np.where(np.arange(8) == 3, wrong, before.params)))


def test_outline_has_the_area_of_the_raster() -> None:
    found = program(SQUARE, HOLE, [(1.0, 1.0, 0.4), (1.3, 1.1, 0.6)])
    assert GRAMMAR.outline(found).area == pytest.approx(raster(found).sum() * CANVAS.pixel**2, rel=5e-3)


def test_arcs_weigh_more_than_lines() -> None:
    assert GRAMMAR.complexity(program(DISH)) == 4.5
    assert replace(GRAMMAR, arc_weight=1.0).complexity(program(DISH)) == 4.0
    assert GRAMMAR.primitives(program(DISH)) == 4
