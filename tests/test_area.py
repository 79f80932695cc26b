"""Exact area coverage: known areas, any window, derivatives by finite differences, and pictures without grey."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from d4cad.canvas import AREA, Canvas
from d4cad.grammars.arc_line import ArcLine, Structure
from d4cad.program import Floats, Program, dense
from d4cad.raster.band import SquaresTable
from d4cad.raster.scan import scan
from d4cad.shapes import generate
from d4cad.sketch import Sketch

Loops = tuple[Floats, Floats, Floats, NDArray[np.int64]]


def linked(sketch: Sketch, pixels: int) -> Loops:
    """A sketch in world units on a square canvas: x, y, bulges, followers."""
    canvas = Canvas.square(pixels)
    points: list[tuple[float, float]] = []
    bulges: list[float] = []
    follow: list[int] = []
    for loop in sketch.loops:
        first, n = len(bulges), len(loop.bulges)
        points += loop.points
        bulges += loop.bulges
        follow += [first + (k + 1) % n for k in range(n)]
    x, y = canvas.to_pixels(np.array(points)).T
    return x.copy(), y.copy(), np.array(bulges), np.array(follow, dtype=np.int64)


def coverage(loops: Loops, window: tuple[int, int, int, int]) -> Floats:
    r0, r1, c0, c1 = window
    row, col, cover, _, _, _, spans = scan(*loops, r0, r1, c0, c1, AREA)
    dense = np.zeros((r1 - r0, c1 - c0))
    for r, start, stop in spans:
        dense[r - r0, start - c0 : stop - c0] = 1
    dense[row - r0, col - c0] = cover
    return dense


def circle(x: float, y: float, r: float) -> Loops:
    return np.array([x - r, x + r]), np.array([y, y]), np.ones(2), np.array([1, 0])


@pytest.mark.parametrize("radius", [0.3, 1.0, 7.77, 40.0])
def test_area_of_a_circle(radius: float) -> None:
    dense = coverage(circle(50.3, 47.9, radius), (0, 100, 0, 100))
    assert dense.sum() == pytest.approx(math.pi * radius**2, abs=1e-9)


def test_circle_pixel_by_pixel() -> None:
    """Against the integral of the half-chord over a pixel: r^2 asin(y / r) / 2 + y sqrt(r^2 - y^2) / 2."""
    r = 10.0

    def under(y: float) -> float:
        return (r * r * math.asin(y / r) + y * math.sqrt(r * r - y * y)) / 2

    dense = coverage(circle(20.0, 20.0, r), (0, 40, 0, 40))
    # The rows' sums to the right of the middle are integrals of the half-chord.
    for row in range(20, 30):
        want = under(row + 1 - 20.0) - under(row - 20.0)
        assert dense[row, 20:].sum() == pytest.approx(want, abs=1e-10)
        assert dense[20:, row].sum() == pytest.approx(want, abs=1e-10)


def test_a_tilted_square_in_one_pixel() -> None:
    x, y = np.array([5.5, 5.9, 5.5, 5.1]), np.array([7.1, 7.5, 7.9, 7.5])
    dense = coverage((x, y, np.zeros(4), np.array([1, 2, 3, 0])), (0, 12, 0, 12))
    assert dense[7, 5] == pytest.approx(0.32, abs=1e-12)
    assert dense.sum() == pytest.approx(0.32, abs=1e-12)


@given(seed=st.integers(0, 500), primitives=st.sampled_from([8, 40]))
@settings(max_examples=25, deadline=None)
def test_area_of_any_part_and_any_window(seed: int, primitives: int) -> None:
    sketch = generate(np.random.default_rng(seed), primitives)
    loops = linked(sketch, 96)
    dense = coverage(loops, (0, 96, 0, 96))
    assert dense.sum() == pytest.approx(sketch.area * 32**2, abs=1e-8)
    assert dense.min() >= 0
    assert dense.max() <= 1
    low, high = np.sort(np.random.default_rng(seed).integers(0, 96, (2, 2)), axis=0)
    part = coverage(loops, (low[0], high[0] + 1, low[1], high[1] + 1))
    np.testing.assert_allclose(part, dense[low[0] : high[0] + 1, low[1] : high[1] + 1], atol=1e-10)


def programs(seed: int, primitives: int, canvas: Canvas) -> tuple[ArcLine, Program[Structure]]:
    grammar = ArcLine(canvas.pixel)
    return grammar, grammar.drawn(generate(np.random.default_rng(seed), primitives).loops)


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_are_finite_differences(seed: int) -> None:
    canvas = Canvas.square(64, AREA)
    grammar, program = programs(seed, 10, canvas)
    weights = np.random.default_rng(seed).normal(size=canvas.shape)
    pulled = grammar.rasterize(program, canvas).pull_back(weights)
    step = 1e-7
    for k in range(program.params.size):
        sums = []
        for sign in (1, -1):
            moved = program.params.copy()
            moved[k] += sign * step
            sums.append(float((grammar.rasterize(program.moved(moved), canvas).coverage * weights).sum()))
        assert pulled[k] == pytest.approx((sums[0] - sums[1]) / (2 * step), rel=1e-5, abs=2e-5)


def test_bulge_derivative_through_zero() -> None:
    """The closed form of an arc and the straight one agree."""
    x, y, follow = np.array([3.2, 20.7, 18.1]), np.array([4.1, 6.3, 21.9]), np.array([1, 2, 0])
    slopes = []
    for bulge in (-2e-6, 0.0, 2e-6):
        *_, edge, slope, _ = scan(x, y, np.array([bulge, 0, 0]), follow, 0, 30, 0, 30, AREA)
        slopes.append(slope[edge == 0, 4])
    np.testing.assert_allclose(slopes[0], slopes[1], rtol=1e-4, atol=3e-3)  # cuts end elsewhere by that
    np.testing.assert_allclose(slopes[2], slopes[1], rtol=1e-4, atol=3e-3)  # cuts end elsewhere by that


@pytest.mark.parametrize("slack", [0.0, 0.02])
def test_loss_and_its_gradient(slack: float) -> None:
    """The table's value is the sum over all pixels, its gradient a finite difference, and J'J holds pairs of edges."""
    canvas = Canvas.square(64, AREA)
    grammar, program = programs(3, 12, canvas)
    target: Floats = np.round(grammar.rasterize(program, canvas).coverage)
    program = program.moved(program.params + np.random.default_rng(0).normal(0, canvas.pixel / 4, program.params.size))
    table = SquaresTable.of(target, slack)
    band = grammar.rasterize(program, canvas)
    off = np.abs(band.coverage - target)
    over = np.maximum(off - 0.5, 0)
    want = off**2 if slack == 0 else (slack * off**2 + over**2) / (slack + 0.25)
    value, force, matrix = table.normal(band)
    assert value == pytest.approx(float(want.sum()), abs=1e-9)
    assert table.value(band) == value
    if slack == 0:
        ones = np.eye(program.params.size)
        columns = [dense_derivative(grammar, program, canvas, k) for k in range(len(ones))]
        jacobian = np.stack([column.ravel() for column in columns], axis=1)
        np.testing.assert_allclose(dense(matrix), jacobian.T @ jacobian, rtol=2e-3, atol=2e-2)
    step = 1e-7
    for k in range(0, program.params.size, 3):
        moved = [program.params.copy() for _ in range(2)]
        moved[0][k] += step
        moved[1][k] -= step
        high, low = (table.value(grammar.rasterize(program.moved(params), canvas)) for params in moved)
        assert 2 * force[k] == pytest.approx((high - low) / (2 * step), rel=1e-4, abs=1e-3)


def dense_derivative(grammar: ArcLine, program: Program[Structure], canvas: Canvas, k: int) -> Floats:
    high, low = program.params.copy(), program.params.copy()
    high[k] += 1e-6
    low[k] -= 1e-6
    pair = [grammar.rasterize(program.moved(params), canvas).coverage for params in (high, low)]
    return np.asarray((pair[0] - pair[1]) / 2e-6)
