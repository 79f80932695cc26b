"""How wide a picture's edges are, and what its noise makes of the price of a primitive."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from d4cad.canvas import AREA, PAPER_RAMP, Canvas
from d4cad.edgemodel import BINARY_PRICE, BLUR_PRICE, ROUNDING, ROUNDING_PRICE, edge_noise, edge_ramp, exact, measured

Floats = NDArray[np.float64]


def disc(ramp: float, size: int = 128, radius: float = 40.3) -> Floats:
    """A disc whose coverage falls linearly over ``ramp`` pixels to each side of its boundary."""
    x, y = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5)
    distance = np.hypot(x - size / 2 - 0.21, y - size / 2) - radius
    return np.asarray(np.clip(0.5 - distance / (2 * ramp), 0, 1))


@pytest.mark.parametrize("ramp", [0.5, PAPER_RAMP, 1.0, 2.0, 3.5])
def test_the_ramp_is_measured(ramp: float) -> None:
    assert edge_ramp(disc(ramp)) == pytest.approx(ramp, rel=0.12)


def test_noise_does_not_widen_the_ramp() -> None:
    noisy = np.clip(disc(1.0) + np.random.default_rng(0).normal(0, 0.05, (128, 128)), 0, 1)
    assert edge_ramp(noisy) == pytest.approx(1.0, rel=0.2)
    assert edge_noise(noisy) == pytest.approx(0.05, rel=0.15)


def test_noise_beside_the_boundary_sets_the_price() -> None:
    noisy = np.clip(disc(0.5) + np.random.default_rng(0).normal(0, 0.05, (128, 128)), 0, 1)
    model = measured(noisy, 0.03)  # what is measured in the picture as a whole, after clipping
    assert model.ramp == AREA
    assert model.floor == pytest.approx(35 * 0.05**2, rel=0.3)
    assert measured(noisy, 0.0).floor == pytest.approx(60 * 0.05**2, rel=0.3)  # at the edges only: a JPEG's


def test_a_clean_picture_is_area_coverage() -> None:
    model = measured(disc(0.5), 0.0)
    assert (model.ramp, model.floor, model.noise) == (AREA, ROUNDING_PRICE * ROUNDING, 0.0)


def test_a_picture_without_grey_has_slack() -> None:
    model = measured((disc(0.5) > 0.5).astype(np.float64), 0.0)
    assert (model.ramp, model.floor) == (AREA, BINARY_PRICE)
    assert model.slack > 0


def test_blur_costs_corners() -> None:
    model = measured(gaussian_filter(disc(0.5), 1.5), 0.0)
    assert model.ramp == pytest.approx(2.6, abs=0.3)
    assert model.floor == pytest.approx(BLUR_PRICE * model.ramp**2)
    assert measured(gaussian_filter(disc(0.5), 9.0), 0.0).ramp == 4.0


def test_an_exact_raster_is_priced_by_its_rounding() -> None:
    canvas = Canvas.square(128)
    assert exact(disc(PAPER_RAMP), canvas).floor == pytest.approx(1e-9 * 128**2)
    eight_bits = np.round(disc(PAPER_RAMP) * 255) / 255
    assert exact(eight_bits, canvas).floor == pytest.approx(125 / 12 / 255**2)
    assert exact(eight_bits, canvas).ramp == PAPER_RAMP


def test_nothing_but_edges() -> None:
    assert 0 <= edge_ramp(np.indices((9, 9)).sum(axis=0) % 2 * 1.0) < 1
