"""The best denoiser of a finite set of pictures, in closed form.

If pictures m are equally likely, what is to be expected behind a noisy x = alpha m + sigma noise is their mean weighted
by exp(-|x - alpha m|^2 / (2 sigma^2)).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from d4cad.errors import InputError
from d4cad.objectives.distillation import Encoded
from d4cad.priors.pixels import cosine, encoded
from d4cad.program import Floats


@dataclass(frozen=True, slots=True, eq=False)
class FiniteDenoiser:
    """The denoiser of given pictures for each prompt.

    size: pixels along a picture. sets: for each prompt pictures (m, size * size) in [-1, 1]; "" are any pictures. A
    picture's code is 2 coverage - 1. The schedule is the cosine's.
    """

    size: int
    sets: Mapping[str, Floats]
    bounded: bool = True

    def __post_init__(self) -> None:
        for prompt, pictures in self.sets.items():
            if pictures.ndim != 2 or pictures.shape[1] != self.size**2 or len(pictures) == 0:
                found = f"{pictures.shape} for {prompt!r}"
                raise InputError(f"expected pictures of shape (m, {self.size**2}) with m >= 1, got {found}")

    @property
    def shape(self) -> tuple[int, ...]:
        """(1, size, size)."""
        return 1, self.size, self.size

    def scales(self, time: float) -> tuple[float, float]:
        """Those of the cosine schedule."""
        return cosine(time)

    def encode(self, pictures: Floats, noise: Floats) -> Encoded:
        """2 pictures - 1, with nothing drawn."""
        return encoded(pictures)

    def noise(self, noisy: Floats, time: float, prompts: Sequence[str]) -> Floats:
        """(noisy - alpha expected) / sigma. Raises InputError for a prompt without pictures."""
        alpha, sigma = self.scales(time)
        flat = noisy.reshape(len(noisy), -1)
        expected = np.array([self.expected(x, time, prompt) for x, prompt in zip(flat, prompts, strict=True)])
        return ((flat - alpha * expected) / sigma).reshape(noisy.shape)

    def expected(self, noisy: Floats, time: float, prompt: str) -> Floats:
        """The picture (size^2,) to be expected behind a noisy one (size^2,)."""
        if prompt not in self.sets:
            raise InputError(f"this prior has no pictures for {prompt!r}")
        alpha, sigma = self.scales(time)
        pictures = self.sets[prompt]
        # |x - alpha m|^2 without its part that all m share
        exponent = (alpha * (pictures @ noisy) - alpha**2 / 2 * np.einsum("ij,ij->i", pictures, pictures)) / sigma**2
        weight = np.exp(exponent - exponent.max())
        return np.asarray(weight @ pictures / weight.sum())
