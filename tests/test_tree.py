"""The Tree grammar's geometry: kinematics, leaves, raster, and the derivatives of all of them."""

from __future__ import annotations

from dataclasses import replace
from math import asin, cos, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from d4cad.canvas import Canvas
from d4cad.errors import GeometryError, GrammarError
from d4cad.grammars.tree import Limits, Structure, Tree, subtree_metric
from d4cad.grammars.tree.kinematics import TreeMatrix, on_canvas, poses_of
from d4cad.grammars.tree.leaves import DISC, LEAVES, POINTED, Leaf, distance, run, slope
from d4cad.grammars.tree.outline import union
from d4cad.grammars.tree.raster import layers, scan
from d4cad.grammars.tree.structure import bounds, program_of, table_of
from d4cad.objectives.image import ImageLoss
from d4cad.program import Floats, Program

CANVAS = Canvas.square(48)
H = 1e-6


def random_tree(seed: int, count: int = 20, root: tuple[float, float] = (0.0, -1.0)) -> Program[Structure]:
    rng = np.random.default_rng(seed)
    parents, children = [-1], [0]
    for node in range(1, count):
        free = [p for p in range(max(0, node - 6), node) if children[p] < 2]
        parents.append(int(rng.choice(free)))
        children[parents[-1]] += 1
        children.append(0)
    table = np.stack([rng.uniform(0.02, 0.2, count), rng.uniform(-0.26, 0.26, count), rng.uniform(0, 0.2, count)], 1)
    return program_of(Structure(tuple(parents), root, Limits(size=0.2)), table)


ROOT = (0.013, -0.021)
"""Off the corners of pixels, which are just a ramp away from their centres."""


def chain(*rows: tuple[float, float, float], size: float = 0.1) -> Program[Structure]:
    structure = Structure(tuple(range(-1, len(rows))), ROOT)
    return program_of(structure, np.array([(0.0, 0.0, size), *rows]))


def with_leaf(program: Program[Structure], leaf: Leaf) -> Program[Structure]:
    return Program(replace(program.structure, leaf=leaf), program.params)


def by_definition(program: Program[Structure], canvas: Canvas, leaf: Leaf) -> Floats:
    """Coverage from every pixel's distance to every leaf, in NumPy and straight from SPEC 2."""
    rows, cols = np.mgrid[: canvas.height, : canvas.width] + 0.5
    least = np.full(canvas.shape, np.inf)
    for x, y, heading, r in on_canvas(poses_of(program), canvas):
        dx, dy = cols - x, rows - y
        t = dx * cos(heading) + dy * sin(heading) - leaf.offset * r
        w = np.abs(dy * cos(heading) - dx * sin(heading))
        e = r * (leaf.reach**2 - 1) / 2
        least = np.minimum(least, np.where(t < 0, np.hypot(w, t) - r, np.hypot(w + e, t) - (r + e)))
    return np.clip(0.5 - least / (2 * canvas.ramp), 0, 1)


# Kinematics


def test_poses_follow_the_branches() -> None:
    pose = poses_of(chain((0.1, 0.0, 0.03), (0.2, pi / 12, 0.04), (0.0, -pi / 12, 0.05)))
    turned = pi / 2 + pi / 12
    expected = [
        (0, 0, pi / 2, 0.1),
        (0, 0.1, pi / 2, 0.03),
        (0.2 * cos(turned), 0.1 + 0.2 * sin(turned), turned, 0.04),
        (0.2 * cos(turned), 0.1 + 0.2 * sin(turned), pi / 2, 0.05),
    ]
    np.testing.assert_allclose(pose - np.array([*ROOT, 0, 0]), expected, atol=1e-15)


SINGULAR = {
    "generic": random_tree(3),
    "no lengths": chain((0.0, 0.1, 0.3), (0.0, -0.2, 0.2), (0.0, 0.0, 0.35)),
    "no sizes": chain((0.4, 0.1, 0.0), (0.5, -0.2, 0.0), (0.4, 0.2, 0.0), size=0.0),
    "coincident": chain((0.3, 0.0, 0.2), (0.0, 0.0, 0.1), (0.3, 0.1, 0.2)),
    "root only": Program(Structure((-1,), (0.1, -0.2)), np.array([0.3])),
}


@pytest.mark.parametrize("name", SINGULAR)
def test_the_jacobian_of_the_poses(name: str) -> None:
    """Through the chain, for a force on each pose number in turn."""
    program = SINGULAR[name]
    band = Tree().rasterize(program, CANVAS)
    assert band.chain is not None
    n = program.params.size
    moved = [program.moved(program.params + s * H * np.eye(n)[k]) for k in range(n) for s in (1, -1)]
    step = np.array([poses_of(one).ravel() for one in moved])
    difference = (step[::2] - step[1::2]) / (2 * H)
    exact = np.stack([band.chain.pull_back(force) for force in np.eye(4 * len(program.structure.parents))], axis=1)
    np.testing.assert_allclose(exact, difference, atol=1e-9)


@pytest.mark.parametrize("name", SINGULAR)
@pytest.mark.parametrize("leaf", LEAVES.values(), ids=LEAVES)
def test_gradient_and_curvature_are_those_of_the_coverage(name: str, leaf: Leaf) -> None:
    program, grammar = with_leaf(SINGULAR[name], leaf), Tree()
    target = np.random.default_rng(1).uniform(size=CANVAS.shape)
    band = grammar.rasterize(program, CANVAS)
    found = ImageLoss.of(target).evaluate(band)
    n = program.params.size

    def covered(params: Floats) -> Floats:
        return grammar.rasterize(program.moved(params), CANVAS).coverage.ravel()

    up = np.stack([covered(program.params + H * e) for e in np.eye(n)], axis=1)
    down = np.stack([covered(program.params - H * e) for e in np.eye(n)], axis=1)
    jacobian = (up - down) / (2 * H)
    residual = (band.coverage - target).ravel()
    np.testing.assert_allclose(found.gradient, 2 * jacobian.T @ residual / CANVAS.size, atol=2e-8)
    np.testing.assert_allclose(band.pull_back(target), jacobian.T @ target.ravel(), atol=1e-4)
    assert isinstance(found.curvature, TreeMatrix)
    curvature = found.curvature.dense()
    np.testing.assert_allclose(curvature, 2 * jacobian.T @ jacobian / CANVAS.size, atol=1e-6)
    np.testing.assert_allclose(found.curvature.diagonal(), np.diagonal(curvature))


@pytest.mark.parametrize("count", [1, 2, 40])
def test_the_tree_matrix_solves_as_a_dense_one(count: int) -> None:
    rng = np.random.default_rng(count)
    program = random_tree(count, count)
    curvature = ImageLoss.of(rng.uniform(size=CANVAS.shape)).evaluate(Tree().rasterize(program, CANVAS)).curvature
    assert isinstance(curvature, TreeMatrix)
    shift, right = rng.uniform(0.01, 1, program.params.size), rng.normal(size=program.params.size)
    matrix = curvature.dense() + np.diag(shift)
    found = curvature.solve(shift, right)
    assert found is not None
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-8)
    assert curvature.solve(-2 * curvature.diagonal() - 1, right) is None


def test_gradients_are_scaled_by_what_hangs_on_a_node() -> None:
    program = program_of(Structure((-1, 0, 1, 1), (0.0, 0.0)), np.zeros((4, 3)))
    assert subtree_metric(program).tolist() == [1.0, *[1 / 3] * 3, *[1.0] * 6]


# Leaves


def test_the_leaf_has_the_paper_s_measures() -> None:
    """The base touches the node, the widest place lies one size ahead of it, the tip 2.6."""
    r, e = 0.5, POINTED.excess
    assert e == pytest.approx(0.78)
    for forward, lateral in ((0, 0), (r, r), (r, -r), (2.6 * r, 0)):
        assert distance(forward, lateral, 1.0, 0.0, r, e, 1.0) == pytest.approx(0, abs=1e-15)
    assert distance(r, 0.0, 1.0, 0.0, r, e, 1.0) == pytest.approx(-r)


def test_a_disc_is_a_disc() -> None:
    for angle in np.linspace(0, 6, 7).tolist():
        assert distance(3 * cos(angle), 3 * sin(angle), cos(1.0), sin(1.0), 2.0, DISC.excess, 0.0) == pytest.approx(1)


@settings(max_examples=200, deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-4, 4), st.floats(0, 2), st.sampled_from(list(LEAVES.values())))
def test_distance_differentiates(x: float, y: float, heading: float, r: float, leaf: Leaf) -> None:
    """Away from the axis ahead, where the two arcs are equally near, and from the centre of the disc."""
    px, py = 0.3, -0.2

    def at(x: float, y: float, heading: float, r: float) -> float:
        return float(distance(px - x, py - y, cos(heading), sin(heading), r, leaf.excess, leaf.offset))

    forward = cos(heading) * (px - x) + sin(heading) * (py - y) - leaf.offset * r
    lateral = cos(heading) * (py - y) - sin(heading) * (px - x)
    if abs(lateral) < 1e-2 or abs(forward) < 1e-4:
        return
    out = np.zeros(4)
    slope(px - x, py - y, cos(heading), sin(heading), r, leaf.excess, leaf.offset, out, 1.0)
    for k, row in enumerate(np.eye(4) * 1e-6):
        low, high = np.array([x, y, heading, r]) - row, np.array([x, y, heading, r]) + row
        if r > 1e-5 or k < 3:
            assert out[k] == pytest.approx((at(*high) - at(*low)) / 2e-6, abs=1e-5)


def test_slopes_are_finite_where_they_are_not_defined() -> None:
    out = np.full(4, np.nan)
    for leaf in (POINTED, DISC):
        for r in (0.0, 0.5):
            for forward in (0.0, leaf.offset * r, (leaf.offset + leaf.reach) * r):
                slope(forward, 0.0, 1.0, 0.0, r, leaf.excess, leaf.offset, out, 1.0)
                assert np.isfinite(out).all()
    slope(0.0, 0.0, 1.0, 0.0, 0.0, POINTED.excess, POINTED.offset, out, 1.0)
    assert out.tolist() == [0, 0, 0, -1 - POINTED.excess]  # a leaf of no size can still grow


@settings(max_examples=200, deadline=None)
@given(
    st.floats(-4, 4),
    st.floats(-4, 4),
    st.floats(-4, 4),
    st.floats(0, 3),
    st.floats(-1, 1),
    st.sampled_from([POINTED, DISC]),
)
def test_a_row_meets_a_level_in_one_run(x: float, y: float, heading: float, r: float, level: float, leaf: Leaf) -> None:
    low, high = run(x, y, cos(heading), sin(heading), r, leaf.excess, leaf.offset, level)
    places = np.linspace(-14, 14, 999)
    for px in places.tolist():
        d = distance(px - x, -y, cos(heading), sin(heading), r, leaf.excess, leaf.offset)
        if abs(d - level) > 1e-6:
            assert (d < level) == (low <= px <= high)


# Raster


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([POINTED, DISC]), st.sampled_from([0.5, 0.70710678, 3.0]))
def test_raster_is_the_least_distance(seed: int, leaf: Leaf, ramp: float) -> None:
    canvas = Canvas(40, 48, 3 / 48, ramp)
    program = with_leaf(random_tree(seed, 25), leaf)
    band = Tree().rasterize(program, canvas)
    exact = by_definition(program, canvas, leaf)
    np.testing.assert_allclose(band.coverage, exact, atol=1e-12)
    assert len(set(zip(band.row.tolist(), band.col.tolist(), strict=True))) == len(band.row)
    inside = np.zeros(canvas.shape, bool)
    for row, first, last in band.spans.tolist():
        assert first < last
        assert not inside[row, first:last].any()
        inside[row, first:last] = True
    assert (inside[np.abs(exact - 0.5) > 1e-9] == (exact[np.abs(exact - 0.5) > 1e-9] > 0.5)).all()
    assert (inside[band.row, band.col] == (band.wound == 1)).all()
    loss = ImageLoss.of(np.random.default_rng(seed).uniform(size=canvas.shape))
    assert loss.value(band) == pytest.approx(np.mean((exact - loss.table.target) ** 2), rel=1e-10)


def test_a_window_is_a_part_of_the_whole() -> None:
    pose = on_canvas(poses_of(random_tree(5)), CANVAS)
    whole = np.zeros(CANVAS.shape)
    row, col, cover, *_ = scan(pose, POINTED.excess, 1.0, 0, 48, 0, 48, CANVAS.ramp)
    whole[row, col] = cover
    row, col, cover, _, _, spans = scan(pose, POINTED.excess, 1.0, 10, 31, 12, 40, CANVAS.ramp)
    part = np.zeros(CANVAS.shape)
    part[row, col] = cover
    np.testing.assert_array_equal(part[10:31, 12:40], whole[10:31, 12:40])
    assert np.count_nonzero(part) == np.count_nonzero(part[10:31, 12:40])
    assert spans[:, 1].min() >= 12
    assert spans[:, 2].max() <= 40


def test_the_band_grows_with_the_boundary() -> None:
    """At four times the resolution the band has about four times the pixels, not sixteen."""
    program = random_tree(7, 60)
    small, large = (len(Tree().rasterize(program, Canvas.square(n)).row) for n in (256, 1024))
    assert large < 5 * small


def test_two_layers_tell_what_a_leaf_is_worth() -> None:
    program = random_tree(11, 12)
    pose = on_canvas(poses_of(program), CANVAS)
    best, second, owner = layers(pose, POINTED.excess, 1.0, 48, 48, CANVAS.ramp)
    np.testing.assert_allclose(best, by_definition(program, CANVAS, POINTED), atol=1e-12)
    for node in range(12):
        without = layers(np.delete(pose, node, 0), POINTED.excess, 1.0, 48, 48, CANVAS.ramp)[0]
        np.testing.assert_allclose(np.where(owner == node, second, best), without, atol=1e-12)


# Outline


def test_outline_of_one_leaf_and_of_one_disc() -> None:
    program = Program(Structure((-1,), (0.2, -0.1)), np.array([0.5]))
    big = 0.5 * (1 + POINTED.excess)
    lens = big**2 * asin(0.8 / big) - POINTED.excess * 0.5 * 0.8
    assert Tree().outline(program).area == pytest.approx(pi / 2 * 0.25 + lens, rel=1e-12)
    assert Tree().outline(with_leaf(program, DISC)).area == pytest.approx(pi * 0.25, rel=1e-12)
    tip = max(y for loop in Tree().outline(program).loops for _, y in loop.points)
    assert tip == pytest.approx(-0.1 + 2.6 * 0.5)


@pytest.mark.parametrize("leaf", LEAVES.values(), ids=LEAVES)
@pytest.mark.parametrize("seed", range(4))
def test_outline_has_the_area_of_the_raster(seed: int, leaf: Leaf) -> None:
    program = with_leaf(random_tree(seed, 30), leaf)
    fine = Canvas.square(2048)
    sketch = Tree().outline(program)
    raster = Tree().rasterize(program, fine).coverage.sum() * fine.pixel**2
    assert sketch.area == pytest.approx(raster, rel=1e-3)


def test_branches_join_all_leaves_into_one_part() -> None:
    program = with_leaf(chain((0.2, 0.1, 0.05), (0.2, -0.1, 0.0), (0.2, 0.1, 0.05), (0.0, 0.0, 0.05), size=0.05), DISC)
    assert len(Tree().outline(program).faces) == 3
    joined = Tree().outline(program, branches=0.02)
    assert len(joined.faces) == 1
    assert joined.area > Tree().outline(program).area
    bare = chain((0.2, 0.0, 0.0), size=0.0)
    for width in (0.0, 0.1):
        with pytest.raises(GeometryError, match="bounds no region"):
            Tree().outline(bare, branches=width)


def test_pinholes_and_specks_are_no_part() -> None:
    """Three discs that leave a gap of under a pixel of the paper's canvas between them, and one far smaller."""

    def found(side: float) -> list[int]:
        discs = [(0.0, 0.0, 0.2), (side, 0.0, 0.2), (side / 2, side * sqrt(0.75), 0.2), (1.0, 1.0, 0.004)]
        pose = np.array([(x, y, 0.0, r) for x, y, r in discs])
        return [len(face.holes) for face in union((-1, 0, 0, 0), pose, DISC, 0.0).faces]

    assert found(0.348) == [0]
    assert found(0.38) == [1]


# Structure and limits


@pytest.mark.parametrize("parents", [(), (0,), (-1, 1), (-1, -1), (-1, 0, 2)])
def test_wrong_parents_are_refused(parents: tuple[int, ...]) -> None:
    with pytest.raises(GrammarError):
        Structure(parents, (0.0, 0.0))


def test_limits() -> None:
    program = chain((0.3, 0.5, 0.2), (-0.1, -0.5, -0.1))
    low, high = bounds(program)
    assert low.tolist() == [0, 0, -pi / 12, 0, 0, -pi / 12, 0]
    assert high.tolist() == [0.075, 0.2, pi / 12, 0.075, 0.2, pi / 12, 0.075]
    repaired = Tree(least=0.0).repair(program).program
    assert repaired.params.tolist() == np.clip(program.params, low, high).tolist()
    assert Tree(least=0.0).repair(repaired).program is repaired
    fixed = program_of(Structure((-1, 0), (0.0, 0.0), Limits(sized=False)), np.array([(0, 0, 0.1), (0.1, 0, 0.2)]))
    assert [side[::3].tolist() for side in bounds(fixed)] == [[0.1, 0.2], [0.1, 0.2]]
    with pytest.raises(GrammarError, match="finite"):
        Tree().repair(program.moved(program.params * np.nan))


def test_structures_round_trip_and_hash() -> None:
    structure = Structure((-1, 0, 1, 1), (0.5, -1.5), Limits(size=0.1, sized=False), DISC)
    assert Tree().decode(Tree().encode(structure)) == structure
    assert hash(structure) == hash(Structure((-1, 0, 1, 1), (0.5, -1.5), Limits(size=0.1, sized=False), DISC))
    good = Tree().encode(structure)
    wrong: object
    for wrong in (
        None, [], {}, {**good, "parents": [-1, 0.5]}, {**good, "parents": 3}, {**good, "root": [1]},
        {**good, "root": ["a", 2]}, {**good, "limits": {"length": -1, "angle": 0, "size": 1, "sized": True}},
        {**good, "limits": {"length": 1}, "root": [float("nan"), 0]}, {**good, "parents": [-1, 5]},
        {**good, "leaf": "oak"},
    ):  # fmt: skip
        with pytest.raises(GrammarError):
            Tree().decode(wrong)


def test_the_axiom_stands_at_the_bottom() -> None:
    canvas = Canvas(60, 40, 3 / 60)
    frame = Tree().axiom(canvas)
    assert frame.structure.root == (0.0, -1.0)
    assert table_of(frame).tolist() == [[0, 0, 0.075], [0.1, 0, 0.075]]
    target = np.zeros(canvas.shape)
    target[5, 20:31] = 1
    target[6:9, 10:20] = 1
    seated = Tree(bottom="shape").made_for(target, canvas).axiom(canvas)
    assert seated.structure.root == pytest.approx((-0.225, -0.725))
    assert Tree().made_for(target, canvas).axiom(canvas).structure.root == (0.0, -1.0)
    empty = Tree(bottom="shape").made_for(np.zeros(canvas.shape), canvas)
    assert empty.axiom(canvas).structure.root == (0.0, -1.0)
