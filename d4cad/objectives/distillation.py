"""Score distillation (Poole et al. 2022, "DreamFusion"): a denoiser pulls a shape towards what a prompt says.

Coverage is shown to a denoiser under noise; what it takes the noise to be, against what the noise was, says how the
picture would have to change to be likelier. A round's noise, time and views are drawn once, so that all its programs
are compared on the same ones, and a program that was seen in it is not asked for again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from d4cad.errors import InputError
from d4cad.objectives.image import ImageLoss
from d4cad.objectives.views import PLAIN, View, Views
from d4cad.program import Floats
from d4cad.protocols import Evaluation
from d4cad.raster.band import Band


@dataclass(frozen=True, slots=True, eq=False)
class Encoded:
    """Pictures as a denoiser sees them.

    codes: (b, *shape). pull_back: from d/dcodes to d/dpictures (b, size, size).
    """

    codes: Floats
    pull_back: Callable[[Floats], Floats]


class Denoiser(Protocol):
    """A diffusion model of pictures; NumPy at its border, whatever is inside.

    Time runs from 0, no noise, to 1, nothing but noise. A noisy code is alpha(t) code + sigma(t) noise with alpha^2 +
    sigma^2 = 1.
    """

    @property
    def size(self) -> int:
        """Pixels along the square pictures."""
        ...

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of one code."""
        ...

    @property
    def bounded(self) -> bool:
        """Whether codes are within [-1, 1], which estimates are then clipped to."""
        ...

    def scales(self, time: float) -> tuple[float, float]:
        """(alpha, sigma), both positive."""
        ...

    def encode(self, pictures: Floats, noise: Floats) -> Encoded:
        """Coverage (b, size, size), row 0 lowest, 1 in the shape, as codes; ``noise`` (b, *shape) for encoders that
        draw."""
        ...

    def noise(self, noisy: Floats, time: float, prompts: Sequence[str]) -> Floats:
        """The noise in codes (b, *shape), one prompt each; the empty prompt is that of any picture."""
        ...


def _sds(alpha: float, sigma: float) -> float:
    return alpha * sigma * sigma * alpha / sigma


def _x0(alpha: float, sigma: float) -> float:
    return 1.0


def _snr(alpha: float, sigma: float) -> float:
    return min(alpha * alpha / (sigma * sigma), 5.0) / 5.0


WEIGHTINGS: dict[str, Callable[[float, float], float]] = {"sds": _sds, "x0": _x0, "snr": _snr}
"""Weight of code - estimate, given alpha and sigma; noise estimate - noise is alpha / sigma times that.

sds: the paper's alpha sigma^2 times the error of the noise. x0: the plain error of the picture. snr: that times
alpha^2 / sigma^2, which weighs the error of the noise evenly, up to 5 (Hang et al. 2023), over 5.
"""


@dataclass(frozen=True, slots=True)
class Wish:
    """What is asked of a denoiser.

    guidance: how far the prompt's estimate is followed beyond that of ``negative`` (Ho and Salimans 2022): 1 is the
    prompt's own. weighting: a key of WEIGHTINGS. Raises InputError for values that mean nothing.
    """

    prompt: str
    negative: str = ""
    guidance: float = 7.0
    weighting: str = "x0"

    def __post_init__(self) -> None:
        if not self.prompt.strip():
            raise InputError("the prompt is empty, expected a word such as star")
        if self.weighting not in WEIGHTINGS:
            raise InputError(f"there is no weighting {self.weighting!r}, expected one of: {', '.join(WEIGHTINGS)}")
        if not (np.isfinite(self.guidance) and self.guidance >= 0):
            raise InputError(f"the guidance must be 0 or more, got {self.guidance:g}")


@dataclass(frozen=True, slots=True, eq=False)
class Pull:
    """What a denoiser says of one raster.

    value: the weighted squared distance from its estimates. gradient: (height, width) of it by coverage, the estimates
    held fixed. near: around that raster the value is ``scale`` times this loss and a constant, to first order; to
    second order along the gradient.
    """

    value: float
    gradient: Floats
    near: ImageLoss
    scale: float


@dataclass(frozen=True, slots=True, eq=False)
class DistillationLoss:
    """Score distillation with all that is random in it drawn.

    time: in (0, 1). noise, drawn: (b, *shape), the noise on the codes and that for the encoder. views: b of them.
    """

    denoiser: Denoiser
    wish: Wish
    time: float
    noise: Floats
    drawn: Floats
    views: tuple[View, ...]
    seen: dict[bytes, Pull] = field(default_factory=dict)

    def value(self, band: Band) -> float:
        """Half the weighted mean square of code - estimate."""
        return self.pull(band.coverage).value

    def evaluate(self, band: Band) -> Evaluation:
        """That with its gradient, the estimates held fixed, and the curvature of ``Pull.near``."""
        pull = self.pull(band.coverage)
        curvature = pull.near.evaluate(band).curvature
        assert curvature is not None
        return Evaluation(pull.value, band.pull_back(pull.gradient), curvature * pull.scale)

    def demand(self, band: Band) -> Floats:
        """Where the estimate has more material, (height, width) in [-1, 1]."""
        return np.clip(self.pull(band.coverage).near.demand(band), -1, 1)

    def pull(self, coverage: Floats) -> Pull:
        """What the denoiser says of a raster; once for each."""
        key = coverage.tobytes()
        if key not in self.seen:
            self.seen[key] = self._pull(coverage)
        return self.seen[key]

    def _pull(self, coverage: Floats) -> Pull:
        pictures = np.array([view.show(coverage) for view in self.views])
        encoded = self.denoiser.encode(pictures, self.drawn)
        off = encoded.codes - self.estimate(encoded.codes)
        weight = WEIGHTINGS[self.wish.weighting](*self.denoiser.scales(self.time))
        back = encoded.pull_back(off * (weight / off.size))
        gradient = np.sum(
            [view.back(part, coverage.shape) for view, part in zip(self.views, back, strict=True)], axis=0
        )
        value = 0.5 * weight * float(np.mean(off * off))
        # With J the derivative of codes by coverage, this is the Rayleigh quotient of the curvature J J' at off: exact
        # where J is a multiple of an isometry, as for pixels. Each pixel then wants gradient / curvature less.
        size = float(np.sum(off * off)) * weight / off.size
        stiffness = float(np.sum(gradient * gradient)) / size if size > 0 else 1.0
        wanted = coverage - gradient / stiffness if stiffness > 0 else coverage
        return Pull(value, gradient, ImageLoss.of(wanted), stiffness * coverage.size / 2)

    def estimate(self, codes: Floats) -> Floats:
        """The picture that the denoiser sees behind the noise, guided, as codes (b, *shape)."""
        alpha, sigma = self.denoiser.scales(self.time)
        noisy = alpha * codes + sigma * self.noise
        wish, count = self.wish, len(codes)
        if wish.guidance == 1.0:
            noise = self.denoiser.noise(noisy, self.time, [wish.prompt] * count)
        else:
            both = self.denoiser.noise(
                np.concatenate([noisy, noisy]), self.time, [wish.negative] * count + [wish.prompt] * count
            )
            noise = both[:count] + wish.guidance * (both[count:] - both[:count])
        found = (noisy - sigma * noise) / alpha
        return np.clip(found, -1, 1) if self.denoiser.bounded else np.asarray(found)


@dataclass(slots=True, eq=False)
class Distillation:
    """Score distillation as an objective: each draw is later in the annealing.

    times: the first and the last time. rounds: draws between them; later ones stay at the last. spread: each time is
    drawn uniformly within so much of it. views: how coverage becomes pictures. drawn: draws so far, which the time
    depends on.
    """

    denoiser: Denoiser
    wish: Wish
    times: tuple[float, float] = (0.98, 0.05)
    rounds: int = 40
    spread: float = 0.0
    views: Views = PLAIN
    drawn: int = 0

    def __post_init__(self) -> None:
        first, last = self.times
        if not (0 < last < 1 and 0 < first < 1):
            raise InputError(f"times must be between 0 and 1, got {first:g} and {last:g}")

    def time(self, rng: np.random.Generator) -> float:
        """The time of the next draw."""
        first, last = self.times
        share = min(1.0, self.drawn / max(self.rounds - 1, 1))
        moment = first + (last - first) * share + self.spread * rng.uniform(-1, 1)
        return float(np.clip(moment, 0.001, 0.999))

    def draw(self, rng: np.random.Generator) -> DistillationLoss:
        """A loss with its time, noise and views drawn."""
        time = self.time(rng)
        self.drawn += 1
        views = self.views.draw(self.denoiser.size, rng)
        shape = (len(views), *self.denoiser.shape)
        noise, drawn = rng.standard_normal((2, *shape))
        return DistillationLoss(self.denoiser, self.wish, time, noise, drawn, views)
