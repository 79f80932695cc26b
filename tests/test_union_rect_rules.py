"""Facts of the Union-Rect grammar's rewrites: effect, inverse, jump, guard, conflicts, and what a trial foretells."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, pi

import numpy as np
import pytest

from d4cad.canvas import Canvas
from d4cad.descent import compatible
from d4cad.estimators import LocalFit
from d4cad.grammars.union_rect import FACTS, Structure, UnionRect
from d4cad.grammars.union_rect.places import DemandPlaces, UniformPlaces
from d4cad.grammars.union_rect.rules import merge, merge_gain
from d4cad.grammars.union_rect.structure import program_of, rects_of
from d4cad.objectives.image import ImageLoss
from d4cad.program import Floats, Program, Rewrite
from d4cad.protocols import Trial

CANVAS = Canvas.square(96)
GRAMMAR = UnionRect(CANVAS.pixel)
NOTHING = np.zeros(CANVAS.shape)

Rect = tuple[float, float, float, float, float]
PLATE: Rect = (0.1, -0.05, 0.8, 0.5, 0.3)
BAR: Rect = (-0.2, 0.1, 0.2, 0.9, 0.0)
FAR: Rect = (1.0, 1.0, 0.2, 0.2, 0.5)


def program(*rects: Rect) -> Program[Structure]:
    return program_of(np.array(rects))


def raster(found: Program[Structure]) -> Floats:
    return GRAMMAR.rasterize(found, CANVAS).coverage


def offered(
    found: Program[Structure], rule: str, grammar: UnionRect = GRAMMAR, demand: Floats = NOTHING
) -> list[Rewrite]:
    rewrites = grammar.rewrites(found, demand, CANVAS, np.random.default_rng(0))
    return [rewrite for rewrite in rewrites if rewrite.rule == rule]


def one(found: Program[Structure], *rewrites: Rewrite) -> Program[Structure]:
    return GRAMMAR.apply(found, rewrites).program


def hole(x: float, y: float, hx: float, hy: float, angle: float = 0.0) -> Rewrite:
    return Rewrite("add-hole", frozenset(), (x, y, hx, hy, angle))


def add(*box: float) -> Rewrite:
    return Rewrite("add-rect", frozenset(), box)


def split(i: int, rule: str = "split-h", share: float = 0.5) -> Rewrite:
    return Rewrite(rule, frozenset((i,)), (float(i), share))


def remove(i: int) -> Rewrite:
    return Rewrite("remove", frozenset((i,)), (float(i),))


def join(i: int, j: int) -> Rewrite:
    return Rewrite("merge", frozenset((i, j)), (float(i), float(j)))


def test_every_rule_is_offered_and_has_facts() -> None:
    demand = NOTHING.copy()
    demand[5:12, 5:20] = 1
    demand[45:52, 45:60] = -1
    found = program(PLATE, BAR)
    rewrites = GRAMMAR.rewrites(found, demand, CANVAS, np.random.default_rng(0))
    assert {rewrite.rule for rewrite in rewrites} == set(FACTS) == set(GRAMMAR.rules)
    some = UnionRect(CANVAS.pixel, frozenset({"merge", "remove"}))
    assert {r.rule for r in some.rewrites(found, demand, CANVAS, np.random.default_rng(0))} == {"merge", "remove"}


EFFECTS = [
    ("split-h", (PLATE,), split(0), 2),
    ("split-v", (PLATE,), split(0, "split-v", 0.3), 2),
    ("add-rect", (PLATE,), add(1.0, 1.0, 0.1, 0.2, 0.4), 2),
    ("hole inside", (PLATE,), hole(0.1, -0.05, 0.1, 0.1, 0.3), 4),
    ("hole across a side: three are left", ((0, 0, 0.8, 0.5, 0),), hole(0.0, 0.5, 0.1, 0.1), 3),
    ("hole in a corner: two", ((0, 0, 0.8, 0.5, 0),), hole(0.8, 0.5, 0.1, 0.1), 2),
    ("hole across the whole: two", ((0, 0, 0.8, 0.5, 0),), hole(0.0, 0.0, 0.1, 0.6), 2),
    ("hole over all of one of two: it goes", (PLATE, FAR), hole(1.0, 1.0, 0.3, 0.3), 1),
    ("hole in two that lap", ((0, 0, 0.8, 0.5, 0), (0, 0, 0.5, 0.8, 0)), hole(0.0, 0.0, 0.1, 0.1), 8),
    ("hole beside all: nothing", (PLATE,), hole(1.3, 1.3, 0.05, 0.05), 1),
    ("merge", (PLATE, BAR), join(0, 1), 1),
    ("remove", (PLATE, BAR), remove(0), 1),
    ("remove of the last: refused", (PLATE,), remove(0), 1),
    ("hole over everything: refused", (PLATE,), hole(0.0, 0.0, 1.5, 1.5), 1),
]


@pytest.mark.parametrize(("start", "rewrite", "count"), [e[1:] for e in EFFECTS], ids=[e[0] for e in EFFECTS])
def test_effect(start: Sequence[Rect], rewrite: Rewrite, count: int) -> None:
    found = program(*start)
    done = one(found, rewrite)
    assert done.structure.count == count
    if count != found.structure.count or rewrite.rule == "remove":
        refused = done is found
        assert refused or GRAMMAR.growth(found, rewrite) == count - found.structure.count


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.9])
@pytest.mark.parametrize(("rule", "share"), [("split-h", 0.5), ("split-v", 0.3), ("split-h", 0.01), ("split-v", 0.99)])
def test_merge_undoes_a_split(rule: str, share: float, angle: float) -> None:
    found = program((0.1, -0.05, 0.8, 0.5, angle))
    parts = one(found, split(0, rule, share))
    assert np.abs(raster(parts) - raster(found)).max() < 1e-6
    assert one(parts, join(0, 1)).params == pytest.approx(found.params, abs=1e-12)


def test_remove_undoes_add_rect_and_add_rect_undoes_remove() -> None:
    found = program(PLATE)
    grown = one(found, add(*FAR))
    assert one(grown, remove(1)).params.tolist() == found.params.tolist()
    assert one(one(grown, remove(1)), add(*FAR)).params.tolist() == grown.params.tolist()


def test_add_rect_undoes_add_hole() -> None:
    found = program(PLATE)
    box = (*PLATE[:2], 0.2, 0.1, PLATE[4])
    holed = one(found, hole(*box))
    assert np.abs(raster(one(holed, add(*box))) - raster(found)).max() < 1e-6
    assert GRAMMAR.outline(holed).area == pytest.approx(4 * (0.8 * 0.5 - 0.2 * 0.1), rel=1e-9)


@pytest.mark.parametrize("box", [(0.1, 0.0, 0.2, 0.1, 0.0), (0.1, 0.0, 0.15, 0.15, 0.7), (0.5, 0.2, 0.2, 0.3, 0.2)])
def test_a_hole_empties_its_box_in_every_rectangle_and_reaches_no_further_than_their_frames(box: Rect) -> None:
    found = program(PLATE, BAR, (0.3, 0.0, 0.3, 0.6, 1.1))
    holed = raster(one(found, hole(*box)))
    boxed = raster(program(box))
    assert np.all(holed[boxed >= 1] < 0.5)
    outer = raster(program((*box[:2], box[2] + box[3], box[2] + box[3], box[4])))
    untouched = outer <= 0
    assert np.abs(holed - raster(found))[untouched].max() < 1e-6


JUMPS = [
    ("a new rectangle of a pixel", add(1.2, 1.2, 0.03, 0.03, 0.4), 5.0),
    ("a hole of a pixel", hole(0.1, 0.0, 0.03, 0.03, 0.3), 5.0),
    ("removal of what is covered", remove(2), 1e-6),
    ("merge of what is covered", join(0, 2), 1e-6),
]


@pytest.mark.parametrize(("rewrite", "change"), [j[1:] for j in JUMPS], ids=[j[0] for j in JUMPS])
def test_jump(rewrite: Rewrite, change: float) -> None:
    """By how many pixels of coverage the raster changes."""
    found = program(PLATE, BAR, (*PLATE[:2], 0.1, 0.05, PLATE[4]))
    assert np.abs(raster(one(found, rewrite)) - raster(found)).sum() <= change


def test_guards() -> None:
    paper = UnionRect(CANVAS.pixel, merge_reach=1.0, merge_limit=0.01, remove_limit=0.005, places=UniformPlaces())
    small: Rect = (0.9, -0.9, 0.05, 0.05, 0.0)
    found = program(PLATE, FAR, small)
    assert [r.data[0] for r in offered(found, "remove", paper)] == [2]
    assert offered(program(small), "remove", paper) == []
    assert len(offered(found, "remove")) == 3
    assert offered(program(FAR, (-1.0, -1.0, 0.2, 0.2, 0.0)), "merge") == []
    assert len(offered(program(PLATE, FAR), "merge")) == 1
    assert offered(program(PLATE, FAR), "merge", paper) == []
    halves = one(program(PLATE), split(0))
    assert len(offered(halves, "merge", paper)) == 1
    assert offered(program(PLATE, BAR), "merge", paper) == []
    assert len(offered(program(PLATE, BAR), "merge", UnionRect(merge_limit=100.0))) == 1


def test_merge_box() -> None:
    """The smallest box at an angle of either, or from a corner of one to a corner of the other."""
    diagonal = np.array([[-0.3, -0.3, 0.1, 0.1, 0.0], [0.3, 0.3, 0.1, 0.1, 0.0]])
    (box,) = merge(diagonal, 0, 1).new
    assert box[4] % (pi / 2) == pytest.approx(pi / 4)
    assert box[2] * box[3] == pytest.approx((0.3 * 2**0.5 + 0.1 * 2**0.5) * 0.1 * 2**0.5)
    assert merge_gain(diagonal, 0, 1) == pytest.approx(box[2] * box[3] - 0.02)


def test_conflicts() -> None:
    """SPEC 4.4: one change for a rectangle; added rectangles and holes conflict with nothing."""
    found = program(PLATE, BAR, FAR)
    wanted = [
        split(0),
        split(0, "split-v"),
        join(0, 1),
        remove(1),
        remove(2),
        hole(0, 0, 0.1, 0.1),
        add(1, -1, 0.1, 0.1, 0),
    ]
    kept = compatible([Trial(r, 1.0 - 0.1 * k) for k, r in enumerate(wanted)])
    assert [wanted.index(r) for r in kept] == [0, 3, 4, 5, 6]
    done = GRAMMAR.apply(found, kept)
    assert np.all(done.origin == -1)
    one_by_one = one(one(program(PLATE), split(0)), hole(0, 0, 0.1, 0.1), add(1, -1, 0.1, 0.1, 0))
    assert done.program.params == pytest.approx(one_by_one.params)


def test_an_edit_keeps_what_it_does_not_touch() -> None:
    edit = GRAMMAR.apply(program(PLATE, BAR, FAR), [remove(1)])
    assert edit.origin.tolist() == [0, 1, 2, 3, 4, 10, 11, 12, 13, 14]


def test_a_trial_foretells_what_the_whole_picture_shows() -> None:
    """Fitted inside its window with the others at rest: the gain is that of the whole raster."""
    target = program((0.0, 0.0, 0.7, 0.3, 0.2), (0.3, 0.5, 0.2, 0.4, 0.4))
    loss = ImageLoss.of(raster(target))
    found = program((0.0, 0.0, 0.7, 0.3, 0.2))
    band = GRAMMAR.rasterize(found, CANVAS)
    rewrites = GRAMMAR.rewrites(found, loss.demand(band), CANVAS, np.random.default_rng(0))
    price = 1e-5
    trials = LocalFit(12).estimate(found, rewrites, GRAMMAR, loss, CANVAS, price)
    assert trials
    for trial in trials:
        after = one(found, trial.rewrite)
        growth = after.structure.count - 1
        gain = loss.value(band) - loss.value(GRAMMAR.rasterize(after, CANVAS)) - price * growth
        assert trial.gain == pytest.approx(gain, abs=1e-9)
    best = max(trials, key=lambda trial: trial.gain)
    assert loss.value(GRAMMAR.rasterize(one(found, best.rewrite), CANVAS)) < 1e-6


def test_a_removal_is_fitted_with_its_neighbours() -> None:
    target = program((0.0, 0.0, 0.7, 0.3, 0.0))
    loss = ImageLoss.of(raster(target))
    found = program((-0.02, 0.0, 0.68, 0.3, 0.0), (0.6, 0.0, 0.1, 0.3, 0.0))
    trials = LocalFit(12).estimate(found, [remove(1)], GRAMMAR, loss, CANVAS, 1e-4)
    (trial,) = trials
    assert trial.rewrite.sites == {0, 1}
    after = one(found, trial.rewrite)
    assert rects_of(after)[0] == pytest.approx([0.0, 0.0, 0.7, 0.3, 0.0], abs=1e-4)


def test_places_by_demand() -> None:
    demand = NOTHING.copy()
    demand[20:30, 40:70] = 1
    demand[60:63, 60:63] = -0.9
    demand[5, 5] = 1
    fill, empty = DemandPlaces().boxes(demand, NOTHING, CANVAS, np.random.default_rng(0), 1)
    assert len(fill) == len(empty) == 2  # the box of the moments and the deepest square
    x, y, hx, hy, angle = fill[0]
    assert (x, y) == pytest.approx(tuple(CANVAS.to_world(np.array([55.0, 25.0]))))
    assert (hx, hy) == pytest.approx((15 * CANVAS.pixel, 5 * CANVAS.pixel), rel=0.02)
    assert angle % pi == pytest.approx(0.0, abs=1e-9)
    assert DemandPlaces().boxes(NOTHING, NOTHING, CANVAS, np.random.default_rng(0), 1) == ([], [])


def test_places_of_the_paper() -> None:
    inside = NOTHING.copy()
    inside[:, :48] = 1
    rng = np.random.default_rng(3)
    places = UniformPlaces()
    fill, empty = places.boxes(NOTHING, inside, CANVAS, rng, 40)
    assert len(fill) + len(empty) == 40
    assert all(box[0] > 0 and box[2:4] == (0.03, 0.03) and 0 <= box[4] <= pi / 2 for box in fill)
    assert all(box[0] < 0 and box[2:4] == (0.05, 0.05) for box in empty)
    assert len([*fill, *empty]) == 40
    assert all(0 <= share <= 1 for share in places.shares(rng))
    assert UnionRect().merge_limit == inf
