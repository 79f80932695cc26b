"""What is done to a picture before it is fitted: thresholds, uneven light, blur, specks and pinholes."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import InputError

Floats = NDArray[np.float64]

AUTO, OTSU, ADAPTIVE = "auto", "otsu", "adaptive"

REACHES = (1 / 24, 1 / 8, 1 / 3)
"""Radii, as shares of the longer side, within which light is looked for: the nearer where there is enough of it."""
ENOUGH = 1e-3
"""Weight of the surroundings, as a share of the most anywhere, below which the next wider radius decides."""
EDGE = 0.04
"""Least squared gradient of an edge, as a share of the greatest."""
DARKEST = 1 / 64
RESTLESS = 0.15
"""Share of outvoted pixels above which a picture is noise: white noise has 0.36, a drawing hardly any."""
HALO = 2
"""Pixels around a speck that its antialiased rim takes."""


def require_threshold(value: str | float | None) -> str | float:
    """ "auto" (also for None), "otsu", "adaptive", or a number from 0 to 1, which text may hold.

    Raises InputError for anything else.
    """
    if value is None:
        return AUTO
    if isinstance(value, str) and value in (AUTO, OTSU, ADAPTIVE):
        return value
    try:
        level = float(value)
    except (TypeError, ValueError):
        raise InputError(f"expected a threshold of auto, otsu, adaptive or from 0 to 1, got {value!r}") from None
    if not 0 <= level <= 1:
        raise InputError(f"expected a threshold between 0 and 1, or auto, otsu or adaptive, got {value}")
    return level


def require_cleaning(despeckle: int, smooth: float) -> None:
    """Raises InputError unless ``despeckle`` (pixels) and ``smooth`` (pixels) are 0 or more."""
    if despeckle < 0:
        raise InputError(f"expected to drop specks under 0 or more pixels, got {despeckle}")
    if not (isfinite(smooth) and smooth >= 0):
        raise InputError(f"expected a smoothing of 0 or more pixels, got {smooth:g}")


def smoothed(grey: Floats, sigma: float) -> Floats:
    """The picture blurred by a Gaussian of ``sigma`` pixels; its border pixels count on beyond it."""
    if sigma == 0:
        return grey
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(grey, sigma, mode="nearest"), dtype=np.float64)


def evened(grey: Floats) -> Floats:
    """A picture in uneven light as if it were in even light: about 0 where it is dark for its place, 1 where light.

    Light multiplies, so that all is reckoned in logarithms. The local threshold is their mean weighted by the
    gradient's square, which is the grey half-way across the edges nearby (Kittler, Illingworth and Foeglein, Threshold
    selection based on a simple image statistic, 1985, made local). Unlike the mean of a window (Sauvola) it does not
    hollow out shapes that are wider than the window. The picture over its threshold is then scaled between the local
    means of what is clearly below and above, so that antialiased edges stay grey.
    """
    from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

    calm = np.log(np.maximum(gaussian_filter(grey, 1.0, mode="nearest"), DARKEST))
    rows, columns = np.gradient(calm)
    weight = rows**2 + columns**2
    # What flat regions have of noise must not outvote the edges, for they cover far more pixels.
    weight = np.where(weight > max(EDGE * float(weight.max()), 8 * float(np.median(weight))), weight, 0.0)
    if not weight.any():
        return grey
    level = np.exp(_local_mean(calm, weight))
    flat = grey / level
    above = flat > 1
    edge = maximum_filter(above, 5) != minimum_filter(above, 5)
    light = _local_mean(flat, (above & ~edge).astype(np.float64))
    dark = _local_mean(flat, (~above & ~edge).astype(np.float64))
    return np.asarray(np.clip((flat - dark) / np.maximum(light - dark, 1e-3), 0.0, 1.0))


def _local_mean(values: Floats, weight: Floats) -> Floats:
    """The weighted mean of each pixel's surroundings, from the nearest radius that has enough weight, blended.

    Worked out on a grid of at most 256 pixels, for light changes slowly.
    """
    from scipy.ndimage import gaussian_filter, zoom

    step = max(1, -(-max(values.shape) // 256))
    moment, mass = (_shrunk(part, step) for part in (values * weight, weight))
    longest = max(mass.shape)
    found: Any = np.full(mass.shape, float(moment.sum()) / max(float(mass.sum()), 1e-300))
    for reach in reversed(REACHES):
        blur = [gaussian_filter(part, reach * longest, mode="constant") for part in (moment, mass)]
        trust = np.minimum(blur[1] / max(ENOUGH * float(blur[1].max()), 1e-300), 1.0)
        here = np.divide(blur[0], blur[1], out=np.array(found), where=blur[1] > 0)
        found = trust * here + (1 - trust) * found
    if step == 1:
        return np.asarray(found, dtype=np.float64)
    wide = zoom(found, step, order=1, mode="nearest", grid_mode=True)
    return np.asarray(wide[: values.shape[0], : values.shape[1]], dtype=np.float64)


def _shrunk(values: Floats, step: int) -> Floats:
    """Sums over squares of ``step`` pixels, the last ones cut short by the border."""
    rows = np.add.reduceat(values, np.arange(0, values.shape[0], step), axis=0)
    return np.asarray(np.add.reduceat(rows, np.arange(0, values.shape[1], step), axis=1))


def despeckled(target: Floats, pixels: int) -> Floats:
    """Coverage without specks, connected regions over 1/2 of fewer than ``pixels`` pixels, and without such pinholes.

    Specks are connected by sides and corners, pinholes by sides. Their antialiased rims go too.
    """
    if pixels == 0:
        return target
    eight = np.ones((3, 3), dtype=np.bool_)
    ground = 1 - target
    left = _without_small(ground, pixels, None)
    return _without_small(np.where(left == ground, target, 1 - left), pixels, eight)


def _without_small(target: Floats, pixels: int, structure: NDArray[np.bool_] | None) -> Floats:
    from scipy.ndimage import binary_dilation, label

    parts, count = label(target > 0.5, structure)
    small = np.bincount(parts.ravel(), minlength=count + 1) < pixels
    small[0] = False
    if structure is None:  # ground that reaches the border is no pinhole, however little of it there is
        small[np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]])] = False
    specks = small[parts]
    if not specks.any():
        return target
    around = np.ones((3, 3), dtype=np.bool_)
    kept = (parts > 0) & ~specks
    gone = binary_dilation(specks, around, HALO) & ~binary_dilation(kept, around, HALO)
    return np.where(gone | specks, 0.0, target)


def is_restless(target: Floats) -> bool:
    """Whether most of what the middle of a picture shows is single pixels: those that the eight around outvote."""
    from scipy.ndimage import uniform_filter

    height, width = (max(0, side - 512) // 2 for side in target.shape)
    inside = target[height : height + 512, width : width + 512] > 0.5
    return float(np.mean(inside != (uniform_filter(inside.astype(np.float64), 3) > 0.5))) > RESTLESS
