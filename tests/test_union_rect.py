"""The Union-Rect grammar's geometry: raster, slopes, repair, outline."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from d4cad.canvas import Canvas
from d4cad.errors import GrammarError
from d4cad.grammars.union_rect import Structure, UnionRect
from d4cad.grammars.union_rect.outline import union
from d4cad.grammars.union_rect.structure import corners, program_of, rects_of
from d4cad.program import Floats, Program
from d4cad.raster.band import SquaresTable
from d4cad.raster.oracle import coverage as oracle

CANVAS = Canvas.square(48)
GRAMMAR = UnionRect(CANVAS.pixel)


def program(*rects: tuple[float, float, float, float, float]) -> Program[Structure]:
    return program_of(np.array(rects, dtype=np.float64))


def raster(found: Program[Structure], canvas: Canvas = CANVAS) -> Floats:
    return GRAMMAR.rasterize(found, canvas).coverage


def jacobian(found: Program[Structure], canvas: Canvas = CANVAS) -> Floats:
    """Derivative of every pixel by every parameter, (height, width, n), from the band's pull-back."""
    band = GRAMMAR.rasterize(found, canvas)
    dense = np.zeros((*canvas.shape, found.params.size))
    for row, col in zip(band.row.tolist(), band.col.tolist(), strict=True):
        one = np.zeros(canvas.shape)
        one[row, col] = 1
        dense[row, col] = band.pull_back(one)
    return dense


def moved(found: Program[Structure], direction: Floats, step: float) -> Program[Structure]:
    return found.moved(found.params + step * direction)


@st.composite
def unions(draw: st.DrawFn) -> Program[Structure]:
    """Up to six rectangles anywhere, or on a coarse grid, where sides touch, coincide and end on each other."""
    count = draw(st.integers(1, 6))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    rects = np.zeros((count, 5))
    if draw(st.booleans()):
        rects[:, :2], rects[:, 2:4] = rng.uniform(-0.8, 0.8, (count, 2)), rng.uniform(0.07, 0.6, (count, 2))
        rects[:, 4] = rng.uniform(-4, 4, count)
    else:
        rects[:, :2], rects[:, 2:4] = rng.integers(-3, 4, (count, 2)) * 0.2, rng.integers(1, 3, (count, 2)) * 0.2
        rects[:, 4] = rng.integers(-2, 3, count) * pi / 2
    return program_of(rects)


@settings(max_examples=60, deadline=None)
@given(unions())
def test_raster_is_the_signed_distance_of_the_outline(found: Program[Structure]) -> None:
    """Also where sides touch or coincide: by the definition in torch, on the union's own loops."""
    sketch = union(rects_of(found), 1e-3 * CANVAS.pixel)
    points = np.concatenate([np.array(loop.points) for loop in sketch.loops])
    sizes = [len(loop.points) for loop in sketch.loops]
    nxt = np.concatenate([s + (np.arange(n) + 1) % n for s, n in zip(np.cumsum([0, *sizes]), sizes, strict=False)])
    x, y = CANVAS.to_pixels(points).T
    tx, ty, tb = (torch.from_numpy(np.ascontiguousarray(v)) for v in (x, y, np.zeros(len(x))))
    exact = oracle(tx, ty, tb, torch.from_numpy(nxt), 0, CANVAS.height, 0, CANVAS.width, CANVAS.ramp).numpy()
    assert np.abs(raster(found) - exact).max() < 1e-3


def test_raster_of_one_rectangle() -> None:
    """Half a side's coverage on the side, 1 inside, 0 outside, and the corner's distance."""
    canvas = Canvas.square(30)  # a tenth of a unit a pixel
    found = raster(program((0.0, 0.0, 0.55, 0.35, 0.0)), canvas)
    assert found[15, 15] == 1
    assert found[15, 20] == pytest.approx(0.5)
    assert found[18, 15] == pytest.approx(0.5)
    assert found[15, 22] == 0
    assert found.sum() * canvas.pixel**2 == pytest.approx(4 * 0.55 * 0.35, rel=0.02)


TOUCHING = ((-0.4, 0.0, 0.4, 0.5, 0.0), (0.4, 0.0, 0.4, 0.5, 0.0))
TILTED = (0.1, -0.05, 0.71, 0.52, 0.37)


@pytest.mark.parametrize("angle", [0.0, 0.3, pi / 4, pi / 2, 2.9])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.77])
@pytest.mark.parametrize("lap", [0.0, 4.0])
def test_a_split_leaves_no_seam(angle: float, share: float, lap: float) -> None:
    """SPEC 2a: the published distance has one, 0.5 along the cut."""
    whole = program((0.1, -0.05, 0.71, 0.52, angle))
    grammar = UnionRect(CANVAS.pixel, lap=lap)
    for rule in ("split-h", "split-v"):
        rewrites = grammar.rewrites(whole, np.zeros(CANVAS.shape), CANVAS, np.random.default_rng(0))
        one = next(r for r in rewrites if r.rule == rule)
        cut = type(one)(rule, one.sites, (0.0, share))
        parts = grammar.apply(whole, [cut]).program
        assert parts.structure.count == 2
        assert np.abs(raster(parts) - raster(whole)).max() < 1e-6


def test_four_parts_that_meet_in_a_point_leave_no_dot() -> None:
    quarters = [(sx * 0.3, sy * 0.3, 0.3, 0.3, 0.0) for sx in (-1, 1) for sy in (-1, 1)]
    assert np.abs(raster(program(*quarters)) - raster(program((0.0, 0.0, 0.6, 0.6, 0.0)))).max() < 1e-6


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_slopes_are_finite_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    rects = np.c_[rng.uniform(-0.7, 0.7, (n, 2)), rng.uniform(0.1, 0.6, (n, 2)), rng.uniform(-4, 4, n)]
    found = program_of(rects)
    exact = jacobian(found)
    h = 1e-6
    for k in range(5 * n):
        e = np.eye(5 * n)[k]
        rough = (raster(moved(found, e, h)) - raster(moved(found, e, -h))) / (2 * h)
        # A pixel whose nearest side changes within the step is a kink of the distance.
        assert np.count_nonzero(np.abs(rough - exact[:, :, k]) > 1e-3) <= 2


ONE_SIDED = [
    ("sides back to back move into each other", TOUCHING, {2: 1.0, 0: -1.0}),
    ("the free side of one of two that touch", TOUCHING, {0: -1.0, 2: 1.0}),
    ("both parts of a split turn about the whole's centre", TOUCHING, {4: 1.0, 9: 1.0, 1: -0.4, 6: 0.4}),
    ("both parts of a split are lifted", TOUCHING, {1: 1.0, 6: 1.0}),
    ("a corner on a side goes in", ((0.0, 0.0, 0.5, 0.5, 0.0), (0.5 + 0.3 * 2**0.5, 0.0, 0.3, 0.3, pi / 4)), {5: -1.0}),
    ("the inner one of two moves", ((0.0, 0.0, 0.6, 0.6, 0.1), (0.1, 0.0, 0.2, 0.1, 0.5)), {5: 1.0, 7: 1.0, 9: 1.0}),
    ("two alike move as one", (TILTED, TILTED), {0: 1.0, 5: 1.0}),
    ("sides in one line", ((-0.4, 0.0, 0.5, 0.4, 0.0), (0.4, 0.0, 0.5, 0.4, 0.0)), {1: 1.0, 6: 1.0}),
]
"""A singular place, and a direction (parameter: speed) in which the union stays smooth."""


@pytest.mark.parametrize(("rects", "direction"), [case[1:] for case in ONE_SIDED], ids=[case[0] for case in ONE_SIDED])
def test_slopes_in_singular_places(rects: tuple[tuple[float, ...], ...], direction: dict[int, float]) -> None:
    found = program_of(np.array(rects))
    toward = np.zeros(found.params.size)
    toward[list(direction)] = list(direction.values())
    h = 1e-5
    rough = (raster(moved(found, toward, h)) - raster(found)) / h
    assert np.count_nonzero(np.abs(rough - jacobian(found) @ toward) > 2e-2) <= 2


def test_a_hidden_rectangle_has_no_slope() -> None:
    assert np.all(jacobian(program((0.0, 0.0, 0.6, 0.6, 0.1), (0.1, 0.0, 0.2, 0.1, 0.5)))[:, :, 5:] == 0)


@pytest.mark.parametrize("size", [(0.0, 0.4), (0.0, 0.0), (-0.1, 0.4)])
def test_a_rectangle_without_area(size: tuple[float, float]) -> None:
    """A drawn line, from which a gradient can widen it; nothing is inside, nothing divides by zero."""
    found = program((0.011, 0.007, *size, 0.3))
    band = GRAMMAR.rasterize(found, CANVAS)
    assert np.all(band.wound == 0)
    assert np.all(band.cover <= 0.5)
    assert np.isfinite(band.slope).all()
    grown = band.pull_back(np.ones(CANVAS.shape))
    assert np.all(grown[2:4] > 0)


def test_squared_error_has_pixels_of_two_rectangles() -> None:
    """Gauss-Newton of the dense Jacobian, inner corners between two rectangles included."""
    found = program((0.0, 0.0, 0.7, 0.2, 0.05), (0.02, 0.01, 0.2, 0.7, -0.1))
    band = GRAMMAR.rasterize(found, CANVAS.with_ramp(3.0))
    assert len(set(zip(band.row.tolist(), band.col.tolist(), strict=True))) < band.row.size
    target = np.random.default_rng(0).uniform(size=CANVAS.shape)
    dense = jacobian(found, CANVAS.with_ramp(3.0)).reshape(-1, 10)
    value, force, matrix = SquaresTable.of(target).normal(band)
    residual = (band.coverage - target).ravel()
    assert value == pytest.approx(residual @ residual)
    assert force == pytest.approx(dense.T @ residual)
    assert matrix == pytest.approx(dense.T @ dense)


@settings(max_examples=80, deadline=None)
@given(unions())
def test_repair_keeps_the_union(found: Program[Structure]) -> None:
    edit = GRAMMAR.repair(found)
    assert np.abs(raster(edit.program) - raster(found)).max() < 1e-6
    assert edit.program.structure.count <= found.structure.count
    assert GRAMMAR.outline(edit.program).area == pytest.approx(GRAMMAR.outline(found).area, rel=1e-4)
    assert GRAMMAR.repair(edit.program).program is edit.program
    assert np.all(rects_of(edit.program)[:, 2:4] <= np.max(rects_of(found)[:, 2:4]) + 1e-9)


REPAIRS = [
    ("covered by one", ((0, 0, 0.8, 0.8, 0), (0.1, 0.1, 0.3, 0.3, 0.4)), 1),
    ("covered by two that touch", ((-0.3, 0, 0.3, 0.5, 0), (0.3, 0, 0.3, 0.5, 0), (0, 0, 0.2, 0.2, 0.3)), 2),
    ("twice the same", (TILTED, TILTED), 1),
    ("an inner gap is not covered", ((-0.4, 0, 0.3, 0.5, 0), (0.4, 0, 0.3, 0.5, 0), (0, 0, 0.3, 0.2, 0)), 3),
    ("under the least size", ((0, 0, 0.5, 0.5, 0), (0.9, 0, 0.001, 0.3, 0)), 1),
    ("the only one, however thin", ((0.9, 0, 0.001, 0.3, 0),), 1),
]


@pytest.mark.parametrize(("rects", "count"), [case[1:] for case in REPAIRS], ids=[case[0] for case in REPAIRS])
def test_repair_drops(rects: tuple[tuple[float, ...], ...], count: int) -> None:
    assert GRAMMAR.repair(program_of(np.array(rects))).program.structure.count == count


def test_repair_shrinks_what_is_covered_up_to_a_lap() -> None:
    found = program((0.0, 0.0, 0.5, 0.5, 0.0), (0.5, 0.0, 0.4, 0.2, 0.0))
    rects = rects_of(GRAMMAR.repair(found).program)
    lap = GRAMMAR.lap * GRAMMAR.pixel
    assert rects[0] == pytest.approx([0.0, 0.0, 0.5, 0.5, 0.0])
    low, high = rects[1, 0] - rects[1, 2], rects[1, 0] + rects[1, 2]
    assert (low, high) == pytest.approx((0.5 - lap, 0.9))


def test_repair_tells_where_parameters_come_from() -> None:
    found = program((0.1, 0.1, 0.3, 0.3, 0.4), (0.0, 0.0, 0.8, 0.8, 0.0))
    edit = GRAMMAR.repair(found)
    assert edit.origin.tolist() == [5, 6, 7, 8, 9]
    with pytest.raises(GrammarError, match="finite"):
        GRAMMAR.repair(found.moved(np.full(10, np.nan)))


def test_outline_is_exact() -> None:
    cross = program((0.0, 0.0, 0.9, 0.2, 0.0), (0.0, 0.0, 0.2, 0.6, 0.0))
    sketch = GRAMMAR.outline(cross).simplified(1e-6)
    assert sketch.area == pytest.approx(4 * (0.9 * 0.2 + 0.2 * 0.6 - 0.2 * 0.2), rel=1e-12)
    assert sketch.primitives == 12
    frame = program((0, 0.5, 0.6, 0.1, 0), (0, -0.5, 0.6, 0.1, 0), (0.5, 0, 0.1, 0.6, 0), (-0.5, 0, 0.1, 0.6, 0))
    sketch = GRAMMAR.outline(frame).simplified(1e-6)
    assert sketch.area == pytest.approx(1.2**2 - 0.8**2, rel=1e-12)
    assert [len(face.holes) for face in sketch.faces] == [1]
    assert sketch.primitives == 8


def test_outline_of_a_split_has_no_inner_edge() -> None:
    sketch = GRAMMAR.outline(program(*TOUCHING)).simplified(1e-6)
    assert sketch.primitives == 4
    assert sketch.area == pytest.approx(1.6 * 1.0)


def test_rectangles_come_apart() -> None:
    found = program((0.0, 0.0, 0.9, 0.2, 0.3), (0.0, 0.0, 0.2, 0.6, 0.0))
    sketches = GRAMMAR.rectangles(found)
    assert [sketch.area for sketch in sketches] == pytest.approx([4 * 0.9 * 0.2, 4 * 0.2 * 0.6])
    assert np.array(sketches[0].loops[0].points) == pytest.approx(corners(rects_of(found))[0])


def test_program_files() -> None:
    found = program(TILTED, (0.0, 0.0, 0.2, 0.6, 0.0))
    assert GRAMMAR.decode(GRAMMAR.encode(found.structure)) == found.structure
    for wrong in (None, 3, {"rectangles": "2"}, {"rectangles": True}, {"rectangles": 0}):
        with pytest.raises(GrammarError):
            GRAMMAR.decode(wrong)
