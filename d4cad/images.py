"""Bitmap in: decode a picture, find its two levels, and return coverage with the shape as 1."""

from __future__ import annotations

import os
import struct
import warnings
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import InputError
from d4cad.preprocess import ADAPTIVE, AUTO, OTSU, despeckled, evened, require_cleaning, require_threshold, smoothed

if TYPE_CHECKING:
    from PIL.Image import Image

Floats = NDArray[np.float64]

FORMATS = ("PNG", "JPEG", "BMP", "TIFF", "WEBP", "GIF")
MAX_PIXELS = 50_000_000
MIN_SIDE = 8

BROKEN = (
    OSError,
    SyntaxError,
    ValueError,
    TypeError,
    LookupError,
    ArithmeticError,
    EOFError,
    struct.error,
    zlib.error,
)
"""What Pillow raises for damaged files: it has no error of its own."""

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Rec. 709 weights of red, green and blue."""

BINS = 256
"""Of the histogram of grey levels."""

MIN_CONTRAST = 0.04
"""Smallest difference of the two levels, of full scale, that counts as a shape: 10 of 255."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A decoded picture.

    ``target``: (H, W) float64 coverage in [0, 1], 1 inside the shape, row 0 is the *lowest*.
    ``dpi``: pixels per inch as the file states it, None where it does not or where x and y differ.
    ``noise``: estimated standard deviation of the noise in the units of ``target``, measured in flat
    regions before clipping; 0 for a clean or thresholded picture.
    ``name``: the file's name, or "array".
    ``notes``: what was assumed about it, a sentence each.
    """

    target: Floats
    dpi: float | None
    noise: float
    name: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Pixels:
    """A decoded picture before anything is made of it.

    ``values``: (H, W) grey or (H, W, 2 to 4) colour in [0, 1], top row first. ``dpi``, ``name``, ``notes``: as
    :class:`Picture` has them.
    """

    values: Floats
    dpi: float | None
    name: str
    notes: tuple[str, ...] = ()


def load(
    source: str | os.PathLike[str] | NDArray[Any],
    *,
    threshold: str | float | None = None,
    invert: bool = False,
    max_pixels: int = MAX_PIXELS,
    smooth: float = 0.0,
    despeckle: int = 0,
) -> Picture:
    """Read a PNG, JPEG, BMP, TIFF, WebP or GIF file, or take an array, as the coverage of a shape.

    An array is a picture: row 0 is its top row. It is (H, W) grey or (H, W, C) with C = 1 grey, 2 grey and
    alpha, 3 RGB, 4 RGBA; bool, integers (0..1, 0..255 or 0..65535) or floats in [0, 1].

    Colour becomes Rec. 709 luminance of the stored values. Where alpha varies from clear to opaque, alpha is
    read instead, and what is opaque is the shape. Otherwise the background is what most of the border is,
    and the shape is the other level. ``invert`` exchanges the two.

    ``threshold``: None or "auto" keeps antialiased grey: the two dominating levels become 0 and 1, the rest is scaled
    between them and clipped. "adaptive" does so after the light is evened out, for photographs. "otsu", or a number
    in [0, 1], makes the picture binary at that grey level. ``smooth``: standard deviation in pixels of a Gaussian
    blur that comes first. ``despeckle``: specks and pinholes of fewer pixels go.
    ``max_pixels``: a larger picture is refused before its pixels are decoded.

    Raises :class:`InputError` for anything that is not a picture of two levels.
    """
    cut = require_threshold(threshold)
    require_cleaning(despeckle, smooth)
    read = decode(source, max_pixels=max_pixels)
    name = read.name
    grey, has_alpha = _grey(read.values, name)
    plain = evened(grey) if cut == ADAPTIVE else grey
    grey = smoothed(plain, smooth)

    dark, light = _levels(grey, name)
    if cut in (AUTO, ADAPTIVE):
        # Measured before the blur: afterwards neighbours share the noise, and outlines follow it all the same.
        noise = _noise((plain - dark) / (light - dark))
        target = np.clip((grey - dark) / (light - dark), 0, 1)
    else:
        level = float(np.nextafter(_otsu(_histogram(grey)) / BINS, 0)) if cut == OTSU else float(cut)
        target, noise = (grey > level).astype(np.float64), 0.0
        if target.min() == target.max():
            side = "above" if target.max() else "at or below"
            raise InputError(
                f"expected a threshold between the levels {dark:.2f} and {light:.2f} of {name}, "
                f"but all of it is {side} {level:g}"
            )
    background_is_light = not has_alpha and _border_is_light(target)
    if background_is_light != invert:
        target = 1 - target
    target = despeckled(target, despeckle)
    if despeckle and not (target > 0.5).any():
        raise InputError(f"expected a shape of {despeckle} or more pixels, but {name} has only smaller specks")
    return Picture(np.ascontiguousarray(target[::-1]), read.dpi, noise, name, read.notes)


def decode(source: str | os.PathLike[str] | NDArray[Any], *, max_pixels: int = MAX_PIXELS) -> Pixels:
    """The values of a file or an array as :func:`load` takes it. Raises InputError for what is no picture."""
    if isinstance(source, np.ndarray):
        _check_size(source.shape, max_pixels, "array")
        return Pixels(_unit_array(source), None, "array")
    if isinstance(source, str | os.PathLike):
        return _read(Path(source), max_pixels)
    raise InputError(f"expected the path of a picture or an array, got {type(source).__name__}")


def _read(path: Path, max_pixels: int) -> Pixels:
    """Decode a file; of several frames or pages the first."""
    from PIL import Image, ImageOps, UnidentifiedImageError

    if path.is_dir():
        raise InputError(f"expected a picture, but {path} is a directory")
    try:
        with warnings.catch_warnings():
            # Pillow warns of sizes, for which we have our own limit, and of metadata, which we hardly use.
            warnings.simplefilter("ignore")
            with Image.open(path, formats=FORMATS) as image:
                _check_size((image.height, image.width), max_pixels, path.name)
                frames = int(getattr(image, "n_frames", 1))
                image.load()
                upright, dpi = ImageOps.exif_transpose(image), _resolution(image)
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"expected a picture, but there is no file {path}") from None
    except PermissionError:
        raise InputError(f"expected a picture, but {path} may not be read") from None
    except Image.DecompressionBombError:
        raise InputError(_too_large(max_pixels, "far more", path.name)) from None
    except UnidentifiedImageError:
        raise InputError(f"expected a PNG, JPEG, BMP, TIFF, WebP or GIF picture, but {path} is none of these") from None
    except BROKEN as error:
        raise InputError(f"expected a complete picture, but {path} is damaged or cut short ({error})") from None
    notes = (f"{path.name} has {frames} frames or pages: the first is used",) if frames > 1 else ()
    return Pixels(_pixels(upright, path.name), dpi, path.name, notes)


def _resolution(image: Image) -> float | None:
    x, y = image.info.get("dpi", (0, 0))
    x, y = float(x), float(y)
    return (x + y) / 2 if x > 1 and abs(x - y) <= 0.01 * x else None


def _pixels(upright: Image, name: str) -> Floats:
    """A decoded image of any mode as values in [0, 1]: (H, W) grey or (H, W, 3 or 4) colour."""
    if upright.mode == "F" or upright.mode.startswith("I"):
        wide = np.asarray(upright).astype(np.float64)
        if not np.isfinite(wide).all():
            raise InputError(f"expected finite grey values, but {name} has NaN or infinite ones")
        return _wide_range(wide, integers=upright.mode != "F")
    if upright.has_transparency_data:
        upright = upright.convert("RGBA")
    elif upright.mode not in ("1", "L", "RGB"):
        upright = upright.convert("RGB")
    values = np.asarray(upright)
    return values.astype(np.float64) if values.dtype == np.bool_ else values / 255.0


def _wide_range(values: Floats, *, integers: bool) -> Floats:
    """Grey of more than 8 bits, for which no file says the white level, as [0, 1]."""
    low, high = float(values.min()), float(values.max())
    if integers and low >= 0 and high <= 65535:
        return values / 65535
    if low >= 0 and high <= 1:
        return values
    return (values - low) / max(high - low, 1.0)


def _unit_array(array: NDArray[Any]) -> Floats:
    """An array of any real dtype as values in [0, 1]."""
    if array.dtype == np.bool_:
        return array.astype(np.float64)
    if not (np.issubdtype(array.dtype, np.integer) or np.issubdtype(array.dtype, np.floating)):
        raise InputError(f"expected an array of bool, integers or floats, got {array.dtype}")
    values = array.astype(np.float64)
    if not np.isfinite(values).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(values))[0])
        raise InputError(f"expected finite values, but the array has {values[where]} at {where}")
    low, high = values.min(), values.max()
    scale = 1.0
    if np.issubdtype(array.dtype, np.integer) and high > 1:
        scale = 255.0 if high <= 255 else 65535.0
    if low < 0 or high > scale:
        raise InputError(f"expected array values from 0 to 1, 255 or 65535, got {low:g} to {high:g}")
    return values / scale


def _check_size(shape: tuple[int, ...], max_pixels: int, name: str) -> None:
    if len(shape) not in (2, 3) or (len(shape) == 3 and shape[2] not in (1, 2, 3, 4)):
        raise InputError(f"expected an array (height, width) or (height, width, 1 to 4), got shape {shape}")
    height, width = shape[:2]
    if height * width > max_pixels:
        raise InputError(_too_large(max_pixels, f"{width}x{height}", name))
    if min(height, width) < MIN_SIDE:
        raise InputError(f"expected at least {MIN_SIDE}x{MIN_SIDE} pixels, but {name} has {width}x{height}")


def _too_large(max_pixels: int, got: str, name: str) -> str:
    return f"expected at most {max_pixels / 1e6:g} million pixels, but {name} has {got}"


def _grey(pixels: Floats, name: str) -> tuple[Floats, bool]:
    """Alpha where it varies, else luminance: (H, W) in [0, 1], and whether it is alpha."""
    if pixels.ndim == 2:
        return pixels, False
    channels = pixels.shape[2]
    if channels in (2, 4):
        alpha = pixels[..., -1]
        if alpha.max() - alpha.min() > 0.5:
            return alpha, True
        if alpha.max() < 0.5:
            raise InputError(f"expected something to see, but {name} is transparent everywhere")
    return (pixels[..., :3] @ LUMINANCE if channels >= 3 else pixels[..., 0]), False


def _levels(grey: Floats, name: str) -> tuple[float, float]:
    """The two dominating grey levels (dark, light): the modes on both sides of Otsu's threshold."""
    counts = _histogram(grey)
    split = _otsu(counts)
    dark = _mode(grey, counts, 0, split)
    light = _mode(grey, counts, split, BINS)
    if light - dark < MIN_CONTRAST:
        raise InputError(
            f"expected a dark shape on light ground or the reverse, but {name} has no contrast: "
            f"its grey levels are {dark:.2f} and {light:.2f} of 1"
        )
    return dark, light


def _histogram(grey: Floats) -> NDArray[np.int64]:
    return np.bincount(np.minimum((grey * BINS).astype(np.int64), BINS - 1).ravel(), minlength=BINS)


def _otsu(counts: NDArray[np.int64]) -> int:
    """The first bin of the upper class that maximises the variance between the classes (Otsu 1979)."""
    weight = np.cumsum(counts)[:-1].astype(np.float64)
    moment = np.cumsum(counts * np.arange(counts.size))[:-1].astype(np.float64)
    total, mean = float(counts.sum()), float((counts * np.arange(counts.size)).sum()) / counts.sum()
    both = weight * (total - weight)
    between = np.divide((mean * weight - moment) ** 2, both, out=np.zeros_like(both), where=both > 0)
    best = np.flatnonzero(between >= between.max() * (1 - 1e-12))
    return int((best[0] + best[-1]) // 2) + 1


def _mode(grey: Floats, counts: NDArray[np.int64], first: int, last: int) -> float:
    """The level around which most pixels of bins [first, last) lie: exact where they share one value."""
    reach = 12  # bins; wider than JPEG noise, narrower than what separates two levels
    window = np.convolve(counts[first:last], np.ones(2 * reach + 1), mode="same") if last > first else np.zeros(0)
    if not window.any():
        return float(grey.mean())
    peaks = np.flatnonzero(window == window.max())
    peak = first + int(peaks[len(peaks) // 2])
    low, high = max(first, peak - reach) / counts.size, min(last, peak + reach + 1) / counts.size
    near = grey[(grey >= low) & ((grey < high) | (high >= 1))]
    return float(np.median(near))


def _border_is_light(target: Floats) -> bool:
    """Whether most border pixels are light; where they tie, whether most pixels are."""
    border = np.concatenate([target[0], target[-1], target[1:-1, 0], target[1:-1, -1]]) > 0.5
    share = float(border.mean())
    return share > 0.5 if share != 0.5 else float(target.mean()) > 0.5


def _noise(scaled: Floats) -> float:
    """Standard deviation of the noise where a 7x7 neighbourhood lies on one side of 1/2.

    The mask [1 -2 1; -2 4 -2; 1 -2 1] cancels shading up to second order; for white noise its response
    has 6 times the noise's deviation (Immerkaer, Fast Noise Variance Estimation, 1996).
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    inside = scaled > 0.5
    flat = (minimum_filter(inside, size=7) == maximum_filter(inside, size=7))[1:-1, 1:-1]
    if not flat.any():
        return 0.0
    across = scaled[:, :-2] - 2 * scaled[:, 1:-1] + scaled[:, 2:]
    response = across[:-2] - 2 * across[1:-1] + across[2:]
    # Rounding leaves about 1e-16 in a clean picture, which is no noise.
    sigma = float(np.sqrt(np.mean(response[flat] ** 2))) / 6
    return sigma if sigma > 1e-9 else 0.0
