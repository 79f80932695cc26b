"""The raster: the compiled scanline kernel and the dense torch oracle under one test, and what is built on them."""

from __future__ import annotations

import doctest
import importlib
import math
import sys
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from d4cad.canvas import Canvas
from d4cad.errors import InputError
from d4cad.grammars.arc_line import ArcLine
from d4cad.grammars.arc_line.structure import Structure
from d4cad.program import Floats, Program
from d4cad.raster.band import Band, SquaresTable
from d4cad.raster.scan import scan
from d4cad.shapes import generate

RAMP = 1 / math.sqrt(2)
calm = settings(max_examples=60, deadline=None)  # a loaded machine is no failure


class Loops(NamedTuple):
    """Linked loops in pixels: x, y of each vertex, bulge of the edge from it, (n,) each, and the vertex it ends at."""

    x: Floats
    y: Floats
    b: Floats
    nxt: NDArray[np.int64]

    @property
    def numbers(self) -> Floats:
        """(3 n,): all x, then all y, then all bulges."""
        return np.concatenate([self.x, self.y, self.b])

    def moved(self, numbers: Floats) -> Loops:
        x, y, b = numbers.reshape(3, -1)
        return Loops(x, y, b, self.nxt)


def loops(*parts: list[tuple[float, float, float]]) -> Loops:
    """Loops of vertices (x, y, bulge of the edge that starts there)."""
    x, y, b = np.array([vertex for part in parts for vertex in part], dtype=np.float64).T.copy()
    starts = np.cumsum([0, *map(len, parts)])
    nxt = np.concatenate([np.roll(np.arange(a, z), -1) for a, z in pairwise(starts)])
    return Loops(x, y, b, nxt)


def polygon(*points: tuple[float, float]) -> list[tuple[float, float, float]]:
    return [(x, y, 0.0) for x, y in points]


def circle(x: float, y: float, r: float, b: float = 1.0) -> list[tuple[float, float, float]]:
    """Two semicircles, counter-clockwise for b = 1 and clockwise for b = -1."""
    return [(x - r, y, b), (x + r, y, b)]


class Picture(NamedTuple):
    """coverage: (rows, columns) of the window. pull: weights of that shape to the derivative by ``Loops.numbers``."""

    coverage: Floats
    pull: Callable[[Floats], Floats]


Window = tuple[int, int, int, int]
Render = Callable[[Loops, Window, float], Picture]


def band_of(shape: Loops, window: Window, ramp: float) -> Band:
    """The kernel's band, moved to the window's corner."""
    r0, r1, c0, c1 = window
    row, col, cover, wound, edge, slope, spans = scan(*shape, r0, r1, c0, c1, ramp)
    n = len(shape.x)
    start, end = np.arange(n), shape.nxt
    columns = np.stack([start, n + start, end, n + end, 2 * n + start], axis=1)
    spans = spans - np.array([r0, c0, c0])
    return Band((r1 - r0, c1 - c0), row - r0, col - c0, cover, wound, edge, slope, columns, spans, 3 * n)


def compiled(shape: Loops, window: Window, ramp: float) -> Picture:
    band = band_of(shape, window, ramp)
    return Picture(band.coverage, band.pull_back)


def oracle(shape: Loops, window: Window, ramp: float) -> Picture:
    torch = pytest.importorskip("torch")
    from d4cad.raster.oracle import coverage

    torch.set_num_threads(1)  # threads cost more than they bring at this size
    leaves = [torch.tensor(part, requires_grad=True) for part in (shape.x, shape.y, shape.b)]
    x, y, b = leaves
    dense = coverage(x, y, b, torch.tensor(shape.nxt), *window, ramp)

    def pull(weights: Floats) -> Floats:
        parts = torch.autograd.grad(dense, leaves, torch.tensor(weights), retain_graph=True, materialize_grads=True)
        return np.concatenate([part.numpy() for part in parts])

    return Picture(dense.detach().numpy(), pull)


@pytest.fixture(params=[compiled, oracle], ids=["compiled", "oracle"])
def render(request: pytest.FixtureRequest) -> Render:
    chosen: Render = request.param
    return chosen


def centres(window: Window) -> tuple[Floats, Floats]:
    """x and y of the pixels' centres, (rows, columns) each."""
    r0, r1, c0, c1 = window
    x, y = np.meshgrid(np.arange(c0, c1) + 0.5, np.arange(r0, r1) + 0.5)
    return x, y


def ramped(d: Floats, ramp: float) -> Floats:
    """Coverage for signed distances, negative inside."""
    return np.clip(0.5 - d / (2 * ramp), 0, 1)


# Values known in closed form


SQUARE = polygon((4, 3), (13, 3), (13, 10), (4, 10))


def square_distance(x: Floats, y: Floats) -> Floats:
    outside = np.maximum(np.abs(x - 8.5) - 4.5, np.abs(y - 6.5) - 3.5)
    beyond = np.hypot(np.maximum(np.abs(x - 8.5) - 4.5, 0), np.maximum(np.abs(y - 6.5) - 3.5, 0))
    return np.where(outside > 0, beyond, outside)


@pytest.mark.parametrize("ramp", [0.5, RAMP, 3.0])
@pytest.mark.parametrize("turn", [1, -1], ids=["counter-clockwise", "clockwise"])
def test_square(render: Render, ramp: float, turn: int) -> None:
    window = (0, 14, 0, 18)
    found = render(loops(SQUARE[::turn]), window, ramp).coverage
    np.testing.assert_allclose(found, ramped(square_distance(*centres(window)), ramp), atol=1e-12)


@pytest.mark.parametrize("r", [0.3, 2.0, 5.25])
@pytest.mark.parametrize("b", [1.0, -1.0])
def test_full_circle_of_two_semicircles(render: Render, r: float, b: float) -> None:
    window = (0, 13, 0, 17)
    x, y = centres(window)
    found = render(loops(circle(8.3, 6.1, r, b)), window, RAMP).coverage
    np.testing.assert_allclose(found, ramped(np.hypot(x - 8.3, y - 6.1) - r, RAMP), atol=1e-12)


@pytest.mark.parametrize("sweep", [0.4, 0.9, 1.5], ids=["minor", "nearly half", "major"])
def test_convention_positive_bulge_is_counter_clockwise_to_the_right_of_travel(render: Render, sweep: float) -> None:
    """A circular segment against its definition: the disc cut by the chord, here the upright line x = 9."""
    r, half = 5.0, sweep * math.pi / 2
    cx, cy = 9 - r * math.cos(half), 6.2
    high, low = cy + r * math.sin(half), cy - r * math.sin(half)
    window = (0, 13, 0, 19)
    x, y = centres(window)
    found = render(loops([(9.0, low, math.tan(half / 2)), (9.0, high, 0.0)]), window, RAMP).coverage
    inside = (np.hypot(x - cx, y - cy) < r) & (x > 9)
    angle = np.abs(np.arctan2(y - cy, x - cx))
    to_ends = np.minimum(np.hypot(x - 9, y - low), np.hypot(x - 9, y - high))
    to_arc = np.where(angle <= half, np.abs(np.hypot(x - cx, y - cy) - r), to_ends)
    to_chord = np.hypot(x - 9, y - np.clip(y, low, high))
    d = np.minimum(to_arc, to_chord)
    np.testing.assert_allclose(found, ramped(np.where(inside, -d, d), RAMP), atol=1e-12)


def test_only_winding_number_zero_is_outside(render: Render) -> None:
    """Two discs that overlap (winding 2), one turned over (-1), and a hole (0)."""
    shape = loops(circle(8, 8, 5), circle(12, 8, 5), circle(24, 8, 5, -1.0), *[circle(10, 8, 2, -1.0)] * 2)
    found = render(shape, (0, 16, 0, 32), RAMP).coverage
    row = found[7]
    assert row[5] == row[15] == row[23] == 1
    assert row[9] == row[10] == 0, "2 - 2: the hole"
    assert found[15, 0] == found[0, 20] == 0


def test_empty_where_nothing_reaches(render: Render) -> None:
    far = loops(polygon((100, 100), (120, 100), (110, 130)), circle(-50, 5, 20), circle(5, -90, 40))
    picture = render(far, (0, 8, 0, 9), RAMP)
    assert not picture.coverage.any()
    assert not picture.pull(np.ones((8, 9))).any()


def test_full_inside(render: Render) -> None:
    picture = render(loops(polygon((-50, -60), (70, -50), (60, 80), (-40, 90))), (0, 8, 0, 9), RAMP)
    assert (picture.coverage == 1).all()
    assert not picture.pull(np.ones((8, 9))).any()


# Derivatives: finite differences at ordinary and singular places


def _ring(count: int, bulge: float) -> list[tuple[float, float, float]]:
    turn = 2 * np.pi / count * np.arange(count)
    return [(11.3 + 7.1 * math.cos(a), 8.6 + 6.2 * math.sin(a), bulge) for a in turn.tolist()]


TINY = [1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6]
SHAPES: dict[str, Loops] = {
    "lines": loops(_ring(5, 0.0)),
    "arcs outwards": loops(_ring(5, 0.3)),
    "arcs inwards": loops(_ring(4, -0.25)),
    "bulge exactly 0": loops([(3.2, 2.9, 0.0), (18.1, 4.4, 0.0), (10.2, 14.6, 0.0)]),
    **{f"bulge {b}": loops([(3.2, 2.9, b), (18.1, 4.4, -b), (10.2, 14.6, b)]) for b in TINY},
    **{f"nearly level arc, bulge {b}": loops([(3.0, 5.5 - 1e-9, b), (19.0, 5.5, b), (11.3, 13.9, 0.0)]) for b in TINY},
    **{f"nearly upright arc, bulge {b}": loops([(5.5, 2.2, b), (17.3, 8.1, 0.0), (5.5 + 1e-9, 14, b)]) for b in TINY},
    "level and upright lines on pixel centres": loops(polygon((4.5, 3.5), (17.5, 3.5), (17.5, 12.5), (4.5, 12.5))),
    "level and upright lines on pixel borders": loops(polygon((4, 3), (17, 3), (17, 12), (4, 12))),
    "slanted line through pixel centres": loops(polygon((2.5, 2.5), (14.5, 8.5), (5, 14))),
    "level line of bulge 0 as an arc on pixel centres": loops([(3.5, 4.5, 0.0), (18.5, 4.5, 0.2), (11, 13, 0.0)]),
    "major arcs": loops([(10.1, 5.2, 2.3), (12.2, 6.1, 0.1)]),
    "major arc outwards and inwards": loops([(3, 3, 0), (18.2, 3.1, 0), (12, 13, -1.3), (8.3, 13.2, 0)]),
    "nearly a whole circle": loops([(11.1, 3.2, 40.0), (11.4, 3.21, 0.0)]),
    "half turns": loops([(6.1, 4.2, 0.0), (15.3, 4.1, 1.0), (15.2, 10.1, 0.0), (6.2, 10.3, 1.0)]),
    "turned line through pixel centres": loops(polygon((1.5 + 1e-13, 2.5), (17.5, 12.5 - 1e-13), (3.3, 14.1))),
    "circle of two semicircles": loops(circle(10.7, 8.2, 5.9)),
    "circle inside out": loops(circle(10.7, 8.2, 5.9, -1.0)),
    "circle under a pixel": loops(circle(10.7, 8.2, 0.3)),
    "ring": loops(circle(10.7, 8.2, 6.9), circle(10.2, 8.4, 3.1, -1.0)),
    "near-coincident vertices": loops([(4, 3, 0.1), (17, 4, 0.0), (17.001, 4.0005, 0.2), (11.1, 13.7, 0.0)]),
    "near-coincident vertices, major arc": loops([(4, 3, 0.0), (15, 4, 2.0), (15.002, 4.001, 0.0), (11.1, 13.7, 0.0)]),
    "partly outside": loops([(-6.1, 3.3, 0.2), (31, -4, -0.4), (26, 22, 0.1), (2, 30, 0.0)]),
    "crossing itself": loops([(3.1, 3.3, 0.2), (17, 12.2, -0.3), (17.4, 3.9, 0.0), (4.2, 12.8, 0.4)]),
    "vertex on a pixel centre": loops([(4.5, 3.5, 0.1), (16.5, 4.5, 0.0), (10.5, 13.5, -0.2)]),
}
CANVASES: dict[str, tuple[Window, float]] = {
    "canvas": ((0, 17, 0, 22), RAMP),
    "wide ramp": ((0, 17, 0, 22), 2.3),
    "window": ((3, 12, 5, 15), RAMP),
}


def smooth_derivative(shape: Loops, window: Window, ramp: float, render: Render) -> tuple[Floats, NDArray[np.bool_]]:
    """Central differences (3 n, rows, columns), and the pixels (rows, columns) that are away from every kink.

    At a kink (two edges equally near, the end of the ramp, a vertex) the forward and the backward difference differ.
    """
    step, here = 1e-6, render(shape, window, ramp).coverage
    ahead, behind = (
        np.array(
            [
                render(shape.moved(shape.numbers + h), window, ramp).coverage
                for h in sign * step * np.eye(len(shape.x) * 3)
            ]
        )
        for sign in (1, -1)
    )
    bend = np.abs(ahead - 2 * here + behind) / step
    return (ahead - behind) / (2 * step), (bend < 0.03).all(axis=0)


@pytest.mark.parametrize("canvas", CANVASES)
@pytest.mark.parametrize("name", SHAPES)
def test_derivative_is_the_limit_of_differences(render: Render, name: str, canvas: str) -> None:
    shape, (window, ramp) = SHAPES[name], CANVASES[canvas]
    derivative, smooth = smooth_derivative(shape, window, ramp, render)
    x, y = centres(window)
    at_vertex = (np.hypot(x[..., None] - shape.x, y[..., None] - shape.y) < 0.3).any(axis=2)
    assert (smooth | at_vertex).mean() > 0.9
    picture = render(shape, window, ramp)
    for seed in range(3):
        weights = np.random.default_rng(seed).normal(size=smooth.shape) * smooth
        expected = (derivative * weights).sum(axis=(1, 2))
        np.testing.assert_allclose(
            picture.pull(weights), expected, rtol=1e-5, atol=2e-5 * np.abs(expected).max() + 1e-6
        )


@pytest.mark.parametrize("canvas", CANVASES)
@pytest.mark.parametrize("name", SHAPES)
def test_rasterisers_agree(name: str, canvas: str) -> None:
    shape, (window, ramp) = SHAPES[name], CANVASES[canvas]
    pytest.importorskip("torch")
    one, other = (render(shape, window, ramp) for render in (compiled, oracle))
    np.testing.assert_allclose(one.coverage, other.coverage, atol=1e-12)


def test_pixel_on_an_edge_moves_it(render: Render) -> None:
    """A pixel centre exactly on the line y = 4.5, its inside above: raising the line uncovers it (DESIGN 7a)."""
    shape = loops(polygon((2, 4.5), (18, 4.5), (10, 14)))
    window = (0, 17, 0, 22)
    weights = np.zeros((17, 22))
    weights[4, 9] = 1.0
    picture = render(shape, window, RAMP)
    assert picture.coverage[4, 9] == 0.5
    pulled = picture.pull(weights)
    share = (9.5 - 2) / 16
    np.testing.assert_allclose(pulled[3:6], np.array([share - 1, -share, 0]) / (2 * RAMP), atol=1e-15)


def test_pixel_on_a_vertex_follows_one_of_its_edges(render: Render) -> None:
    shape = loops([(4.5, 3.5, 0.1), (16.5, 4.5, 0.0), (10.5, 13.5, -0.2)])
    weights = np.zeros((17, 22))
    weights[13, 10] = 1.0
    picture = render(shape, (0, 17, 0, 22), RAMP)
    assert picture.coverage[13, 10] == 0.5
    pulled = picture.pull(weights)
    assert np.hypot(pulled[2], pulled[5]) == pytest.approx(1 / (2 * RAMP))
    np.testing.assert_allclose(pulled[[0, 1, 3, 4, 6, 7, 8]], 0, atol=1e-12)


@pytest.mark.parametrize("gap", [0.0, 1e-300, 1e-12, 1e-9, 1e-6])
@pytest.mark.parametrize("bulge", [0.0, 1e-9, 0.5, -3.0])
def test_coincident_vertices_are_finite(render: Render, gap: float, bulge: float) -> None:
    """An edge of no length adds nothing: the picture is that of the shape without it."""
    window = (0, 17, 0, 22)
    whole = [(4.2, 3.1, 0.1), (17.3, 4.4, 0.0), (11.1, 13.7, 0.2)]
    doubled = [whole[0], (17.3, 4.4, bulge), (17.3 + gap, 4.4, 0.0), whole[2]]
    picture = render(loops(doubled), window, RAMP)
    np.testing.assert_allclose(picture.coverage, render(loops(whole), window, RAMP).coverage, atol=1e-5)
    assert np.isfinite(picture.pull(np.ones((17, 22)))).all()


# Properties


coordinate = st.one_of(st.floats(-8, 28), st.integers(-8, 44).map(lambda k: k / 2))
bulge = st.one_of(st.just(0.0), st.sampled_from([s * b for b in TINY for s in (1, -1)]), st.floats(-4, 4))
loop = st.lists(st.tuples(coordinate, coordinate, bulge), min_size=2, max_size=6)
shapes = st.lists(loop, min_size=1, max_size=3).map(lambda parts: loops(*parts))
ramps = st.sampled_from([0.5, RAMP, 1.5, 4.0])


@calm
@given(shapes, ramps)
def test_rasterisers_agree_on_any_loops(shape: Loops, ramp: float) -> None:
    pytest.importorskip("torch")
    window = (0, 19, 0, 22)
    found = compiled(shape, window, ramp).coverage
    np.testing.assert_allclose(found, oracle(shape, window, ramp).coverage, atol=1e-9)


@calm
@given(shapes, ramps, st.integers(0, 18), st.integers(0, 21), st.integers(1, 9), st.integers(1, 9))
def test_window_is_part_of_the_whole(shape: Loops, ramp: float, r0: int, c0: int, height: int, width: int) -> None:
    r1, c1 = min(r0 + height, 19), min(c0 + width, 22)
    whole, part = compiled(shape, (0, 19, 0, 22), ramp), compiled(shape, (r0, r1, c0, c1), ramp)
    np.testing.assert_allclose(part.coverage, whole.coverage[r0:r1, c0:c1], atol=1e-12)
    weights = np.zeros((19, 22))
    weights[r0:r1, c0:c1] = np.random.default_rng(0).normal(size=(r1 - r0, c1 - c0))
    np.testing.assert_allclose(part.pull(weights[r0:r1, c0:c1]), whole.pull(weights), atol=1e-9)


@calm
@given(shapes, ramps)
def test_reversal_keeps_the_picture(shape: Loops, ramp: float) -> None:
    window = (0, 19, 0, 22)
    back = np.empty_like(shape.nxt)
    back[shape.nxt] = np.arange(len(back))
    reversed_shape = Loops(shape.x, shape.y, -shape.b[back], back)
    expected = compiled(shape, window, ramp).coverage
    np.testing.assert_allclose(compiled(reversed_shape, window, ramp).coverage, expected, atol=1e-9)


@calm
@given(shapes, ramps, st.integers(-5, 5), st.integers(-5, 5))
def test_whole_pixels_shift_the_picture(shape: Loops, ramp: float, dx: int, dy: int) -> None:
    moved = Loops(shape.x + dx, shape.y + dy, shape.b, shape.nxt)
    expected = compiled(shape, (0, 19, 0, 22), ramp).coverage
    np.testing.assert_allclose(compiled(moved, (dy, 19 + dy, dx, 22 + dx), ramp).coverage, expected, atol=1e-9)


@calm
@given(shapes, ramps)
def test_translation_derivative_sums_over_the_vertices(shape: Loops, ramp: float) -> None:
    """Moving all vertices by dx is moving the picture: in the smooth middle of the ramp, -d coverage / dx."""
    band = band_of(shape, (0, 19, 0, 22), ramp)
    total = np.stack([band.slope[:, 0] + band.slope[:, 2], band.slope[:, 1] + band.slope[:, 3]], axis=1)
    length = np.hypot(*total.T) * 2 * ramp
    assert np.isfinite(band.slope).all()
    # |grad distance| = 1, or 0 at a vertex
    assert ((np.abs(length - 1) < 1e-6) | (length == 0)).all()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("primitives", [8, 40])
def test_rasterisers_agree_on_parts(primitives: int, seed: int) -> None:
    """Generated parts on a canvas that is not square, values and derivative."""
    pytest.importorskip("torch")
    canvas = Canvas(60, 48, 3 / 60)
    parts = []
    for part in generate(np.random.default_rng(seed), primitives).loops:
        places = canvas.to_pixels(np.array(part.points))
        parts.append([(*place, b) for place, b in zip(places.tolist(), part.bulges, strict=True)])
    shape = loops(*parts)
    one, other = (render(shape, (0, 48, 0, 60), canvas.ramp) for render in (compiled, oracle))
    np.testing.assert_allclose(one.coverage, other.coverage, atol=1e-9)
    weights = np.random.default_rng(seed).normal(size=canvas.shape)
    np.testing.assert_allclose(one.pull(weights), other.pull(weights), atol=1e-7)


def test_same_shape_same_bits() -> None:
    shape = SHAPES["ring"]
    first, second = (scan(*shape, 0, 17, 0, 22, RAMP) for _ in range(2))
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a, b)


# What is built on the kernel


def mixed_program() -> Program[Structure]:
    """A part of lines and arcs with a round hole, in the world of the square canvas."""
    structure = Structure((4, 2), (False, True, False, True, True, True))
    points = [-0.813, -0.707, 0.911, -0.758, 1.027, 0.633, -0.721, 0.834, -0.317, 0.113, 0.409, 0.131]
    return Program(structure, np.array([*points, 0.3, -0.2, -1.0, -1.0]))


def dense_jacobian(band: Band) -> Floats:
    """(height, width, size) by pulling back one pixel at a time."""
    pixels = np.eye(band.shape[0] * band.shape[1]).reshape(-1, *band.shape)
    return np.stack([band.pull_back(pixel) for pixel in pixels]).reshape(*band.shape, band.size)


@pytest.mark.parametrize("canvas", [Canvas.square(24), Canvas(30, 18, 0.1), Canvas(17, 29, 3 / 29, 1.6)], ids=str)
def test_normal_equations_are_those_of_the_dense_jacobian(canvas: Canvas) -> None:
    band = ArcLine().rasterize(mixed_program(), canvas)
    target = np.random.default_rng(5).uniform(size=canvas.shape)
    table = SquaresTable.of(target)
    jacobian, residual = dense_jacobian(band), band.coverage - target
    value, gradient, matrix = table.normal(band)
    assert isinstance(matrix, np.ndarray)
    assert value == pytest.approx((residual**2).sum(), rel=1e-12)
    assert table.value(band) == pytest.approx(value, rel=1e-12)
    np.testing.assert_allclose(gradient, np.einsum("ijk,ij->k", jacobian, residual), atol=1e-10)
    np.testing.assert_allclose(matrix, np.einsum("ijk,ijl->kl", jacobian, jacobian), rtol=1e-10, atol=1e-9)


@pytest.mark.parametrize("canvas", [Canvas.square(24), Canvas(30, 18, 0.1)], ids=str)
def test_arc_line_raster_differentiates_by_its_parameters(canvas: Canvas) -> None:
    """World units, lines without a bulge, and the order of the parameters."""
    program, grammar, step = mixed_program(), ArcLine(), 1e-6
    weights = np.random.default_rng(6).normal(size=canvas.shape)

    def total(params: Floats) -> float:
        return float((grammar.rasterize(program.moved(params), canvas).coverage * weights).sum())

    nudges = step * np.eye(len(program.params))
    expected = [(total(program.params + nudge) - total(program.params - nudge)) / (2 * step) for nudge in nudges]
    found = grammar.rasterize(program, canvas).pull_back(weights)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


def test_perfect_target_has_no_error() -> None:
    band = ArcLine().rasterize(mixed_program(), Canvas.square(64))
    value, gradient, _ = SquaresTable.of(band.coverage).normal(band)
    assert 0 <= value < 1e-10
    assert np.abs(gradient).max() < 1e-12


# torch


def test_soft_raster_passes_gradcheck() -> None:
    torch = pytest.importorskip("torch")
    from d4cad.torch import soft_raster

    program, canvas = mixed_program(), Canvas(20, 14, 0.15)
    params = torch.tensor(program.params, requires_grad=True)
    assert torch.autograd.gradcheck(lambda p: soft_raster(p, program, canvas), (params,), eps=1e-7, atol=1e-5)


def test_soft_raster_is_the_grammars_raster() -> None:
    torch = pytest.importorskip("torch")
    from d4cad.torch import soft_raster

    program, canvas, grammar = mixed_program(), Canvas(30, 18, 0.1), ArcLine()
    band = grammar.rasterize(program, canvas)
    weights = np.random.default_rng(7).normal(size=canvas.shape)
    for dtype, tolerance in ((torch.float64, 1e-15), (torch.float32, 1e-4)):
        params = torch.tensor(program.params, dtype=dtype, requires_grad=True)
        coverage = soft_raster(params, program.structure, canvas, grammar)
        assert coverage.dtype == dtype
        assert coverage.shape == canvas.shape
        np.testing.assert_allclose(coverage.detach().numpy(), band.coverage, atol=tolerance)
        (coverage * torch.tensor(weights, dtype=dtype)).sum().backward()
        np.testing.assert_allclose(params.grad.numpy(), band.pull_back(weights), atol=100 * tolerance, rtol=tolerance)


def test_soft_raster_fits_in_a_torch_loop() -> None:
    torch = pytest.importorskip("torch")
    from d4cad.torch import soft_raster

    program, canvas = mixed_program(), Canvas.square(32)
    target = torch.tensor(ArcLine().rasterize(program, canvas).coverage)
    params = torch.tensor(program.params + 0.02 * np.random.default_rng(8).normal(size=16), requires_grad=True)
    optimizer = torch.optim.Adam([params], lr=0.003)
    losses = []
    for _ in range(150):
        optimizer.zero_grad()
        loss = ((soft_raster(params, program, canvas) - target) ** 2).mean()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < losses[0] / 100


def test_soft_raster_example_in_the_docstring() -> None:
    pytest.importorskip("torch")
    result = doctest.testmod(importlib.import_module("d4cad.torch"))
    assert result.attempted > 0
    assert result.failed == 0


@pytest.mark.parametrize(
    ("shape", "dtype"), [((4, 4), "float64"), ((16,), "int64"), ((15,), "float64"), ((16,), "float16")]
)
def test_soft_raster_refuses(shape: tuple[int, ...], dtype: str) -> None:
    torch = pytest.importorskip("torch")
    from d4cad.torch import soft_raster

    with pytest.raises(InputError, match=r"expected params of shape \(16,\) and dtype float32 or float64, got"):
        soft_raster(torch.zeros(shape, dtype=getattr(torch, dtype)), mixed_program(), Canvas.square(8))


def test_without_torch_the_import_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(sys.modules, "d4cad.torch", raising=False)
    with pytest.raises(ImportError, match=r"d4cad.torch needs torch: pip install d4cad\[torch\]"):
        importlib.import_module("d4cad.torch")
