"""Colour pictures taken apart: one coverage, and one fit, for every colour but the ground's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import InputError
from d4cad.fit import Fit
from d4cad.fitting import MARGIN, Watch, fit_picture, touches_border
from d4cad.images import Picture, decode
from d4cad.placement import Placement
from d4cad.preprocess import despeckled, require_cleaning, smoothed
from d4cad.program import Floats
from d4cad.sketch import Sketch

MOST = 16
FLAT = 0.02
"""A pixel is of one colour if no neighbour differs from it by more, in OKLab."""
REACH = 5
"""Side in pixels of the square around a mixed pixel in which the colours that it mixes are found."""
LEAST = 12
"""Pixels that a layer needs to be one."""
SPLIT = 8
"""Clusters that are looked at for each colour asked for."""

OKLAB_LMS = np.array(
    [[0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566],
     [0.0883024619, 0.2817188376, 0.6299787005]]
)  # fmt: skip
OKLAB = np.array(
    [[0.2104542553, 0.7936177850, -0.0040720468], [1.9779984951, -2.4285922050, 0.4505937099],
     [0.0259040371, 0.7827717662, -0.8086757660]]
)  # fmt: skip

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Layer:
    """One colour of a picture. color: #rrggbb. target: (height, width) its coverage, row 0 lowest."""

    color: str
    target: Floats


def oklab(rgb: Floats) -> Floats:
    """Colours (..., 3), sRGB in [0, 1], in the perceptual space OKLab (https://bottosson.github.io/posts/oklab/)."""
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return np.asarray(np.cbrt(linear @ OKLAB_LMS.T) @ OKLAB.T)


def layers(
    source: str | PathLike[str] | NDArray[Any], count: int, *, smooth: float = 0.0, despeckle: int = 0
) -> tuple[Layer, ...]:
    """The colours of a picture beside its ground, at most ``count``, the largest first.

    The ground is the colour of most of the border, or what is transparent. Colours are the means of clusters of the
    pixels of flat regions in OKLab: Pillow's median cut, and what is nearest joined. On a boundary between two colours
    a pixel's coverage is its share of each, so that antialiased edges keep their place. smooth, despeckle: as
    :func:`d4cad.images.load` has them. Raises InputError for a picture of one colour.
    """
    if not 1 <= count <= MOST:
        raise InputError(f"expected 1 to {MOST} layers, got {count}")
    require_cleaning(despeckle, smooth)
    read = decode(source)
    rgb, opaque = _on_white(read.values)
    rgb = np.stack([smoothed(channel, smooth) for channel in np.moveaxis(rgb, -1, 0)], axis=-1)
    palette = _palette(rgb, count + 1)
    shares = _shares(rgb, palette)
    if opaque is None:
        ground = _ground(shares)
        kept = [k for k in range(len(palette)) if k != ground]
    else:  # what is transparent is white here, and white may be a colour of the picture as well
        shares = shares * opaque[..., None]
        kept = list(range(len(palette)))
    found = []
    for k in kept:
        target = despeckled(shares[..., k], max(despeckle, LEAST))
        if np.count_nonzero(target > 0.5) >= LEAST:
            found.append(Layer(_hexadecimal(palette[k]), np.ascontiguousarray(target[::-1])))
    if not found:
        raise InputError(f"expected a picture of several colours, but {read.name} has one")
    return tuple(sorted(found, key=lambda layer: -float(layer.target.sum()))[:count])


def fit_layers(
    source: str | PathLike[str] | NDArray[Any],
    count: int,
    *,
    smooth: float = 0.0,
    despeckle: int = 0,
    watch: Watch | None = None,
    each: Callable[[Fit], Fit] | None = None,
    **options: Any,
) -> tuple[tuple[str, Fit], ...]:
    """A colour and its fit for every layer, all on one canvas, the largest first.

    each: what is done to every fit. options: as for :func:`d4cad.fitting.fit_picture`.
    """
    read = decode(source)
    found = []
    split = layers(source, count, smooth=smooth, despeckle=despeckle)
    margin = any(touches_border(layer.target) for layer in split)
    for layer in split:
        # Every layer gets the margin that one of them needs, for they share a canvas.
        target = np.pad(layer.target, MARGIN) if margin else layer.target
        picture = Picture(target, read.dpi, 0.0, f"{read.name} {layer.color}", read.notes)
        asked = {"layer": layer.color, "smooth": smooth, "despeckle": despeckle}
        fit = fit_picture(picture, watch=watch, asked=asked, **options)
        found.append((layer.color, fit if each is None else each(fit)))
    return tuple(found)


def together(fits: Sequence[Fit], placement: Placement) -> Placement:
    """The placement of each of several fits on one canvas by which they lie as in the picture: its width and origin
    are those of all of them."""
    canvas = fits[0].canvas
    everything = Sketch(tuple(face for fit in fits for face in fit.outline.faces))
    xmin, ymin, xmax, ymax = everything.bounds
    zero = (xmin, ymin) if placement.origin == "corner" else ((xmin + xmax) / 2, (ymin + ymax) / 2)
    if placement.width is not None:
        placement = replace(placement, width=None, scale=placement.width * canvas.pixel / (xmax - xmin))
    return replace(placement, origin="drawing", zero=zero)


def _on_white(values: Floats) -> tuple[Floats, Floats | None]:
    """Colours (H, W, 3), and the opacity where it varies."""
    if values.ndim == 2:
        values = values[..., None]
    channels = values.shape[2]
    color = np.repeat(values[..., :1], 3, axis=2) if channels < 3 else values[..., :3]
    if channels in (1, 3):
        return color, None
    alpha = values[..., -1]
    color = np.where(alpha[..., None] > 0, color, 1.0)
    return color, alpha if float(np.ptp(alpha)) > 0.5 else None


def _palette(rgb: Floats, count: int) -> Floats:
    """At most ``count`` colours (k, 3), sRGB: means of the clusters of what is flat."""
    from scipy.ndimage import maximum_filter, minimum_filter

    lab = oklab(rgb)
    spread = np.stack([maximum_filter(c, 3) - minimum_filter(c, 3) for c in np.moveaxis(lab, -1, 0)]).max(axis=0)
    flat = spread <= FLAT
    # In noise little is flat, or what is white alone: all pixels then.
    for chosen in (flat, np.ones_like(flat)):
        if np.count_nonzero(chosen) >= LEAST:
            colors = _joined(*_clusters(rgb[chosen], lab[chosen], SPLIT * count), count)
            if len(colors) > 1:
                return colors
    raise InputError("expected a picture of several colours, but it has one")


def _clusters(rgb: Floats, lab: Floats, count: int) -> tuple[Floats, Floats]:
    """Mean colours (k, 3) of at most ``count`` clusters of pixels, and how many pixels each has. Median cut splits what
    is frequent, however alike: only among many clusters does a small area have one of its own."""
    from PIL import Image

    # Pillow clusters bytes: the part of OKLab that sRGB fills is L from 0 to 1, a and b within 0.4 of 0.
    coded = np.round(255 * np.clip(lab * [1.0, 1.25, 1.25] + [0.0, 0.5, 0.5], 0, 1)).astype(np.uint8)
    label = np.asarray(Image.fromarray(coded[None]).quantize(count, Image.Quantize.MEDIANCUT, kmeans=1))[0]
    sizes = np.bincount(label)
    used = np.flatnonzero(sizes)
    return np.array([rgb[label == k].mean(axis=0) for k in used]), sizes[used].astype(np.float64)


def _joined(colors: Floats, sizes: Floats, count: int) -> Floats:
    """Clusters of colours (k, 3) and numbers of pixels joined, the pair first that adds least to the sum of squares in
    OKLab (Ward 1963), until at most ``count`` are left and none are alike."""
    colors, weights = colors.copy(), sizes.copy()
    while len(colors) > 1:
        lab = oklab(colors)
        apart = np.abs(lab[:, None] - lab).max(axis=-1)
        added = ((lab[:, None] - lab) ** 2).sum(axis=-1) * weights[:, None] * weights / (weights[:, None] + weights)
        if len(colors) <= count:
            added[apart > FLAT] = np.inf
        np.fill_diagonal(added, np.inf)
        a, b = (int(k) for k in np.unravel_index(np.argmin(added), added.shape))
        if not np.isfinite(added[a, b]):
            break
        colors[a] = (weights[a] * colors[a] + weights[b] * colors[b]) / (weights[a] + weights[b])
        weights[a] += weights[b]
        colors, weights = np.delete(colors, b, axis=0), np.delete(weights, b)
    return colors


def _shares(rgb: Floats, palette: Floats) -> Floats:
    """How much of each pixel each colour covers (H, W, k)."""
    from scipy.ndimage import maximum_filter, minimum_filter

    lab, centres = oklab(rgb), oklab(palette)
    label = np.argmin(np.stack([((lab - centre) ** 2).sum(axis=-1) for centre in centres]), axis=0)
    pure = np.sqrt(((lab - centres[label]) ** 2).sum(axis=-1)) <= 2 * FLAT
    flat = pure & (maximum_filter(label, 3) == minimum_filter(label, 3))
    near = np.stack([maximum_filter(flat & (label == k), REACH) for k in range(len(palette))], axis=-1)
    shares = np.eye(len(palette))[label]
    number = near.sum(axis=-1)
    for a, b in combinations(range(len(palette)), 2):
        mixed = near[..., a] & near[..., b] & (number == 2)
        if mixed.any():
            # Renderers blend the values as they are stored.
            across = palette[a] - palette[b]
            part = np.clip((rgb[mixed] - palette[b]) @ across / (across @ across), 0, 1)
            shares[mixed] = 0.0
            shares[mixed, a], shares[mixed, b] = part, 1 - part
    return np.asarray(shares)


def _ground(shares: Floats) -> int:
    border = np.concatenate([shares[0], shares[-1], shares[:, 0], shares[:, -1]])
    return int(np.argmax(border.sum(axis=0)))


def _hexadecimal(color: Floats) -> str:
    return "#" + "".join(f"{round(255 * float(part)):02x}" for part in color)
