"""The start from a picture's contour."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from d4cad.bench import coverage
from d4cad.canvas import AREA, Canvas
from d4cad.program import Floats
from d4cad.shapes import generate
from d4cad.sketch import Sketch
from d4cad.tracing import contours, traced

CANVAS = Canvas.square(128, AREA)


def ring(noise: float = 0.0) -> Floats:
    x, y = np.meshgrid(np.arange(64) + 0.5, np.arange(64) + 0.5)
    r = np.hypot(x - 31.7, y - 30.2)
    clean = np.clip(20.5 - r, 0, 1) - np.clip(9.5 - r, 0, 1)
    return np.asarray(np.clip(clean + np.random.default_rng(0).normal(0, noise, clean.shape), 0, 1))


def test_contours_lie_on_the_boundary_with_the_inside_on_their_left() -> None:
    outer, inner = sorted(contours(ring()), key=len, reverse=True)
    for points, radius, turn in ((outer, 20.0, 1), (inner, 9.0, -1)):
        assert np.hypot(*(points - (31.7, 30.2)).T) == pytest.approx(radius, abs=0.15)
        z = points @ np.array([1, 1j])
        assert np.sign(np.sum(np.imag(np.conj(z) * np.roll(z, -1)))) == turn


def test_a_shape_at_the_border_is_closed() -> None:
    (points,) = contours(np.ones((10, 20)))
    assert points.min() == pytest.approx(0.0, abs=0.51)
    assert points.max(axis=0) == pytest.approx((20.0, 10.0), abs=0.51)


def test_specks_of_noise_are_no_contours() -> None:
    assert len(contours(ring(0.25), blur=1.0)) == 2


@given(seed=st.integers(0, 300))
@settings(max_examples=10, deadline=None)
def test_traced_loops_bound_nearly_the_shape(seed: int) -> None:
    truth = generate(np.random.default_rng(seed), 10)
    found = Sketch.from_loops(traced(coverage(truth, CANVAS), CANVAS))
    assert len(found.loops) == len(truth.loops)
    assert found.area == pytest.approx(truth.area, rel=0.02)
    assert found.primitives < 4 * truth.primitives
