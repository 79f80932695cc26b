"""How a picture's edges are drawn, and what a primitive must gain there not to fit the drawing's own errors."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from d4cad.canvas import AREA, Canvas
from d4cad.program import Floats

BLURRED = 0.9
"""A ramp that is measured to be wider than this is blurred; below, the measure cannot tell it from area coverage."""
WIDEST = 4.0
BINARY = 0.25
"""A ramp that is measured to be narrower than this belongs to a picture without grey."""
TOUCH = 5
"""Side in pixels of the window within which a pixel may have a share of an edge."""
REACH = 11
"""Side in pixels of the window within which a pixel counts as near an edge."""

AREA_RAMP = 0.5
"""Half-width in pixels of the ramp nearest to area coverage."""
AREA_PRICE = 0.03
"""Least gain of a primitive in summed squared error where area coverage is fitted by that ramp."""
BLUR_PRICE = 0.25
"""The same for each square pixel of a blurred ramp's half-width: a blur also rounds the corners, over such an area."""
BINARY_PRICE = 1.0
"""The same where the picture has no grey: a staircase is off by 1/12 a boundary pixel, for many pixels in a row."""
SLACK = 0.03
"""Weight of the errors within the bounds that such a picture sets: enough to decide between shapes that keep to
them."""
STAIRCASE = 1 / sqrt(12)
"""Standard deviation of a boundary pixel there."""
NOISE_PRICE = 60.0
"""The same in variances of the noise of a pixel, where it is the ringing of a JPEG, which follows the edges."""
WHITE_PRICE = 35.0
"""The same where the noise is white: 20 to 30 by the principle of minimum description length, and some caution."""
WHITE = 0.3
"""White noise has at least this share of its deviation also far from the edges: clipping leaves 0.58 of it."""
ROUNDING_PRICE = 125.0
"""The same in variances of rounding, which repeats itself along a straight edge."""
ROUNDING = 1 / 12 / 255**2
"""Variance of a pixel in 8 bits that comes of rounding alone."""
EXACT_PRICE = 1e-9
"""The same, for each pixel of the canvas, where the picture follows the ramp exactly."""


@dataclass(frozen=True, slots=True)
class EdgeModel:
    """ramp: half-width of the coverage ramp in pixels, 0 for area coverage. floor: least gain of a primitive in summed
    squared error. noise: standard deviation of a pixel at the boundary. slack: as in
    :class:`d4cad.raster.band.SquaresTable`."""

    ramp: float
    floor: float
    noise: float = 0.0
    slack: float = 0.0

    def ramped(self) -> EdgeModel:
        """The model for a raster that knows ramps only, not area coverage."""
        return self if self.ramp != AREA else EdgeModel(AREA_RAMP, max(AREA_PRICE, self.floor), self.noise)


def exact(target: Floats, canvas: Canvas, noise: float = 0.0) -> EdgeModel:
    """The model of a target that was drawn with the canvas' own ramp, as floats or in 8 bits.

    noise: standard deviation of a pixel, rounding to 8 bits excepted.
    """
    levels = target * 255
    rounding = ROUNDING if np.abs(levels - np.round(levels)).max() < 1e-6 else 0.0
    return EdgeModel(canvas.ramp, max(EXACT_PRICE * canvas.size, NOISE_PRICE * noise**2 + ROUNDING_PRICE * rounding))


def measured(target: Floats, noise: float) -> EdgeModel:
    """The model of a picture of unknown make.

    target: coverage (height, width). noise: standard deviation of a pixel in flat regions.
    """
    ramp = edge_ramp(target)
    if ramp < BINARY:
        return EdgeModel(AREA, BINARY_PRICE, STAIRCASE, SLACK)
    beside = edge_noise(target)
    price = WHITE_PRICE if noise > WHITE * beside else NOISE_PRICE
    noise = max(noise, beside)
    noisy = price * noise**2 + ROUNDING_PRICE * ROUNDING
    if ramp < BLURRED:
        return EdgeModel(AREA, noisy, noise)
    ramp = min(ramp, WIDEST)
    return EdgeModel(ramp, max(BLUR_PRICE * ramp**2, noisy), noise)


def edge_noise(target: Floats) -> float:
    """Standard deviation of the noise beside the boundary, where the ringing of a JPEG is.

    Pixels 3 to 5 pixels from it should be 0 or 1. Coverage is clipped there, which leaves half of the variance.
    """
    inside = (target > 0.5).astype(np.uint8)
    beside = _near(inside, REACH) & ~_near(inside, TOUCH)
    if not beside.any():
        return 0.0
    return sqrt(2 * float(np.mean((target - inside)[beside] ** 2)))


def edge_ramp(target: Floats) -> float:
    """The half-width in pixels of the linear ramp that has as much grey along the boundary as the target has.

    Across a ramp of half-width r, coverage (1 - coverage) sums to r / 3; along the boundary the gradient sums to its
    length. What noise adds to the grey is measured beside the
    edges, or further away if they are so wide, and taken off.
    """
    from scipy.ndimage import gaussian_filter

    inside = (target > 0.5).astype(np.uint8)
    near = _near(inside, REACH)
    grey = target * (1 - target)
    along, across = np.gradient(gaussian_filter(target, 1.5))
    length = max(float(np.hypot(along, across)[near].sum()), 1.0)

    def ramp(flat: NDArray[np.bool_]) -> float:
        noise = float(grey[flat].mean()) if flat.any() else 0.0
        return 3 * max(float((grey[near] - noise).sum()), 0.0) / length

    wide = ramp(~near)
    return ramp(near & ~_near(inside, TOUCH)) if wide < TOUCH / 2 else wide


def _near(inside: NDArray[np.uint8], side: int) -> NDArray[np.bool_]:
    """Where a window of ``side`` pixels holds both inside and outside."""
    from scipy.ndimage import maximum_filter, minimum_filter

    return np.asarray(maximum_filter(inside, side) != minimum_filter(inside, side))
