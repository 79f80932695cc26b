"""One program continued through changing pictures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np

from d4cad.animation import Film
from d4cad.descent import Stop
from d4cad.errors import InputError
from d4cad.fit import Fit
from d4cad.fitting import MARGIN, Watch, fit_picture, touches_border
from d4cad.images import Picture, load


def morph(
    images: Sequence[str | PathLike[str]],
    *,
    grammar: str = "arc-line",
    variant: str | None = None,
    method: str = "fast",
    init: str | Fit | None = None,
    seed: int = 0,
    max_time: float | None = None,
    threshold: str | float | None = None,
    invert: bool = False,
    watch: Watch | None = None,
    film: Film | None = None,
) -> Iterator[Fit]:
    """Fit the first picture, then let every further one go on from the program of the one before: a fit for each.

    All pictures are of one size. Relations are not looked for: each picture has its own. max_time: seconds for each.
    film: takes the frames. The rest as for :func:`d4cad.fitting.fit_image`. Ends after an interrupted fit. Raises
    InputError for fewer than two pictures, for different sizes, and as that function does, before the first fit.
    """
    pictures = same_size([load(image, threshold=threshold, invert=invert) for image in images])
    return _fits(pictures, init, film, {
        "grammar": grammar, "variant": variant, "method": method, "seed": seed, "max_time": max_time, "watch": watch,
        "asked": {"threshold": threshold, "invert": invert},
    })  # fmt: skip


def same_size(pictures: Sequence[Picture]) -> list[Picture]:
    """Pictures that lie on one canvas: all get the margin that one of them needs."""
    if len(pictures) < 2:
        raise InputError(f"a morph needs two pictures at least, got {len(pictures)}")
    first = pictures[0]
    for other in pictures[1:]:
        if other.target.shape != first.target.shape:
            sizes = [f"{p.target.shape[1]}x{p.target.shape[0]} ({p.name})" for p in (first, other)]
            raise InputError(f"the pictures of a morph have one size, got {sizes[0]} and {sizes[1]}")
    if any(touches_border(picture.target) for picture in pictures):
        return [replace(picture, target=np.pad(picture.target, MARGIN)) for picture in pictures]
    return list(pictures)


def _fits(pictures: Sequence[Picture], init: str | Fit | None, film: Film | None, how: dict[str, Any]) -> Iterator[Fit]:
    start = init
    for picture in pictures:
        fit = fit_picture(picture, init=start, snap=False, follow=None if film is None else film.follow, **how)
        if film is not None:
            film.end(fit)
        yield fit
        if fit.stop is Stop.INTERRUPTED:
            return
        start = fit
