"""The embedded prior: silhouettes that come with d4cad, each in several poses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from d4cad.priors.finite import FiniteDenoiser
from d4cad.priors.library import Library, shipped
from d4cad.priors.words import found
from d4cad.program import Floats

SIZE = 64
"""Pixels along the pictures of the embedded prior."""

POSES = tuple((across, up, mirror) for across in (0.8, 0.9, 1.0) for up in (0.8, 0.9, 1.0) for mirror in (False, True))
"""Sizes in x and in y, and whether mirrored. None is turned: parts stand upright."""

OTHERS = 96
"""Silhouettes that stand for any picture."""

VARIANTS: Mapping[str, tuple[str, ...]] = {
    "boat": ("boat", "sailboat"),
    "car": ("car", "car-profile"),
    "cloud": ("cloud", "cloud-rain"),
    "fish": ("fish", "fish-simple"),
    "flower": ("flower", "flower-tulip", "flower-lotus"),
    "heart": ("heart", "heart-straight"),
    "house": ("house", "house-line"),
    "person": ("person", "person-simple"),
    "star": ("star", "star-four"),
    "tree": ("tree", "tree-evergreen", "tree-palm"),
}
"""Words with several silhouettes that a person would call so; the first is the plain one."""


def embedded(prompt: str, negative: str = "", variant: int = 0, size: int = SIZE) -> FiniteDenoiser:
    """The denoiser for a prompt, and for a negative one.

    variant: which of several silhouettes of a word, counted around; seeds that differ in it give different designs.
    Raises InputError for an empty or unknown prompt.
    """
    library = shipped()
    tags = dict(zip(library.names, library.tags, strict=True))
    name = found(prompt, library.names, tags)
    choices = VARIANTS.get(name, (name,))
    chosen = choices[variant % len(choices)]
    sets = {prompt: posed(library, [chosen], POSES, size)}
    sets[""] = any_pictures(library, chosen, size)
    if negative.strip():
        sets[negative] = posed(library, [found(negative, library.names, tags)], POSES, size)
    sets.setdefault(negative, sets[""])  # blanks are no words
    return FiniteDenoiser(size, sets)


def any_pictures(library: Library, name: str, size: int) -> Floats:
    """Pictures (m, size^2) of anything, that name among them: evenly spread through the library."""
    step = max(1, len(library.names) // OTHERS)
    names = [*library.names[::step], name]
    return posed(library, names, ((1.0, 1.0, False),), size)


def posed(library: Library, names: Iterable[str], poses: Iterable[tuple[float, float, bool]], size: int) -> Floats:
    """Silhouettes in [-1, 1], each in every pose, (m, size^2)."""
    poses = tuple(poses)
    shown = [drawn(library.picture(name).astype(float), *pose, size) for name in names for pose in poses]
    return np.array(shown) * 2 - 1


def drawn(picture: Floats, across: float, up: float, mirror: bool, size: int) -> Floats:
    """A silhouette (n, n), row 0 lowest, in a pose: coverage (size^2,)."""
    from scipy.ndimage import affine_transform, gaussian_filter

    n = len(picture)
    # from (row, column) of the result to those of the silhouette, both about their centres
    steps = np.array([1 / up, -1 / across if mirror else 1 / across]) * n / size
    centre = (n - 1) / 2 - steps * (size - 1) / 2
    smooth = gaussian_filter(picture, np.abs(steps) / 3, mode="constant")
    return np.asarray(affine_transform(smooth, steps, centre, (size, size), order=1)).ravel()
