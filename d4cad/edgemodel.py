"""How a picture's edges are drawn, and what a primitive must gain there not to fit the drawing's own errors."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from d4cad.canvas import AREA, Canvas
from d4cad.program import Floats

BLURRED = 0.9
"""A ramp that is measured to be wider than this is blurred; below, the measure cannot tell it from area coverage."""
WIDEST = 4.0
BINARY = 0.25
"""A ramp that is measured to be narrower than this belongs to a picture without grey."""
REACH = 11
"""Side in pixels of the window within which a pixel counts as near an edge."""

BLUR_PRICE = 0.25
"""The same for each square pixel of a blurred ramp's half-width: a blur also rounds the corners, over such an area."""
BINARY_PRICE = 2.5
"""The same where the picture has no grey: a staircase is off by 1/12 a boundary pixel, for many pixels in a row."""
STAIRCASE = 1 / sqrt(12)
"""Standard deviation of a boundary pixel there."""
NOISE_PRICE = 125.0
"""The same in variances of the noise of a pixel."""
ROUNDING = 1 / 12 / 255**2
"""Variance of a pixel in 8 bits that comes of rounding alone."""
ROUNDING_PRICE = 1e-9
"""The same, for each pixel of the canvas, where the picture follows the ramp exactly."""


@dataclass(frozen=True, slots=True)
class EdgeModel:
    """ramp: half-width of the coverage ramp in pixels, 0 for area coverage. floor: least gain of a primitive in summed
    squared error. noise: standard deviation of a pixel at the boundary."""

    ramp: float
    floor: float
    noise: float = 0.0


def exact(target: Floats, canvas: Canvas, noise: float = 0.0) -> EdgeModel:
    """The model of a target that was drawn with the canvas' own ramp, as floats or in 8 bits.

    noise: standard deviation of a pixel, rounding to 8 bits excepted.
    """
    levels = target * 255
    rounding = ROUNDING if np.abs(levels - np.round(levels)).max() < 1e-6 else 0.0
    return EdgeModel(canvas.ramp, max(ROUNDING_PRICE * canvas.size, NOISE_PRICE * (noise**2 + rounding)))


def measured(target: Floats, noise: float) -> EdgeModel:
    """The model of a picture of unknown make.

    target: coverage (height, width). noise: standard deviation of a pixel in flat regions.
    """
    ramp = edge_ramp(target)
    if ramp < BINARY:
        return EdgeModel(AREA, BINARY_PRICE, STAIRCASE)
    noisy = NOISE_PRICE * (noise**2 + ROUNDING)
    if ramp < BLURRED:
        return EdgeModel(AREA, noisy, noise)
    ramp = min(ramp, WIDEST)
    return EdgeModel(ramp, max(BLUR_PRICE * ramp**2, noisy), noise)


def edge_ramp(target: Floats) -> float:
    """The half-width in pixels of the linear ramp that has as much grey along the boundary as the target has.

    Across a ramp of half-width r, coverage (1 - coverage) sums to r / 3; along the boundary the gradient sums to its
    length. What noise adds to the grey is measured away from the edges and taken off.
    """
    from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

    inside = (target > 0.5).astype(np.uint8)
    near = maximum_filter(inside, REACH) != minimum_filter(inside, REACH)
    grey = target * (1 - target)
    along, across = np.gradient(gaussian_filter(target, 1.5))
    length = float(np.hypot(along, across)[near].sum())
    noise = float(grey[~near].mean()) if not near.all() else 0.0
    return 3 * max(float((grey[near] - noise).sum()), 0.0) / max(length, 1.0)
