"""The compliance objective: how far a part of given volume gives way under its loads (paper, section 6).

Coverage counts as density. Its ramp has half-width one element and a tent as derivative: of the ramps tried, the one
whose gradient is nearest to that of the solid/void part on a refined mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from d4cad.canvas import Canvas
from d4cad.objectives.domain import Domain
from d4cad.objectives.image import ImageLoss
from d4cad.objectives.symmetry import Work
from d4cad.program import Floats
from d4cad.protocols import Constraint, Evaluation
from d4cad.raster.band import Band, add_normal_equations

WEAK = 1e-4
"""Stiffness of an empty element as a share of the solid's."""


def tented(band: Band) -> Band:
    """The band with coverage that falls by a tent-shaped derivative in place of a constant one.

    With t in [-1, 1] the distance over the ramp's half-width, the linear ramp is (1 - t) / 2; here coverage is
    1/2 - t + sign(t) t^2 / 2, with derivative -(1 - |t|).
    """
    t = 1 - 2 * band.cover
    share = 1 - np.abs(t)
    return replace(band, cover=0.5 - t + np.sign(t) * t * t / 2, slope=band.slope * (2 * share)[:, None])


@dataclass(frozen=True, slots=True, eq=False)
class ComplianceLoss:
    """Compliance over that of the full domain, volume held by a constraint. It is its own objective: nothing is random.

    A program that uses another volume than the domain's is valued as if compliance went with volume to the power of
    -``exponent``, and ``stiffness`` times the square of the relative difference is added: so programs of nearly the
    right volume can be compared, and it does not pay to leave it.
    """

    domain: Domain
    full: float
    halved: ComplianceLoss | None = None
    exponent: float = 1.5
    stiffness: float = 300.0

    @classmethod
    def of(cls, domain: Domain, halved: Domain | None = None) -> ComplianceLoss:
        """The loss of a domain; ``halved``: the same problem on elements of twice the size."""
        whole = np.where(domain.void, WEAK, 1.0)
        return cls(domain, domain.work(whole).compliance, None if halved is None else cls.of(halved))

    def with_volume(self, volume: float) -> ComplianceLoss:
        """The loss of a part of another volume, in elements."""
        halved = None if self.halved is None else self.halved.with_volume(volume / 4)
        return replace(self, domain=replace(self.domain, volume=volume), halved=halved)

    @property
    def coarse(self) -> ComplianceLoss:
        """The loss on elements of twice the size, if there is one."""
        return self.halved or self

    @property
    def coarse_canvas(self) -> Canvas:
        """The canvas of ``coarse``."""
        return self.coarse.domain.canvas

    def likeness(self, band: Band) -> ImageLoss:
        """The squared difference from this raster."""
        return ImageLoss.of(band.coverage)

    def draw(self, rng: np.random.Generator) -> ComplianceLoss:
        """The loss itself."""
        return self

    def density(self, band: Band) -> Floats:
        """(height, width) of the domain."""
        return self.domain.unfolded(tented(band).coverage)

    def response(self, density: Floats) -> Work:
        """Energies and compliance of a density."""
        return self.domain.work(WEAK + density * (1 - WEAK))

    def value(self, band: Band) -> float:
        """The loss."""
        density = self.density(band)
        return self._merit(self.response(density).compliance, float(density.sum()))

    def _merit(self, compliance: float, volume: float) -> float:
        excess = volume / self.domain.volume - 1
        scaled = compliance / self.full * max(1 + excess, 1e-3) ** self.exponent
        return float(scaled + self.stiffness * excess * excess)

    def evaluate(self, band: Band) -> Evaluation:
        """The loss; the gradient of compliance; as curvature the squared motion of the boundary; the volume constraint.

        The curvature is J'J for the derivative J of the coverage: steps measured by it move the boundary, whatever
        parameters describe it.
        """
        soft = tented(band)
        density = self.domain.unfolded(soft.coverage)
        response = self.response(density)
        gradient = soft.pull_back(self.domain.folded(-(1 - WEAK) * response.energy / self.full))
        slope = soft.pull_back(self.domain.folded(np.ones(self.domain.shape)))
        volume = float(density.sum())
        metric = np.zeros((band.size, band.size))
        add_normal_equations(
            np.zeros(band.shape), soft.row, soft.col, soft.cover, soft.piece, soft.slope, soft.columns,
            np.zeros(band.size), metric, 0.0,
        )  # fmt: skip
        constraint = Constraint(volume - self.domain.volume, slope)
        return Evaluation(self._merit(response.compliance, volume), gradient, metric, constraint)

    def demand(self, band: Band) -> Floats:
        """Where a small hole would save more volume than it costs: negative there, on the canvas.

        The topological derivative of compliance for a small round hole in plane stress is 3 w for uniaxial stress of
        energy density w (Garreau, Guillaume and Masmoudi 2001); material is worth its share of the mean.
        """
        density = self.density(band)
        energy = self.response(density).energy * density
        worth = self.exponent * energy.sum() / self.domain.volume
        if worth == 0:  # no material at all: nowhere to make a hole
            return np.zeros(band.shape)
        gain = np.where(density > 0.99, np.clip(3 * energy / worth - 1, -1, 0), 0.0)
        return np.asarray(self.domain.folded(gain) / 2 ** sum(self.domain.mirrored))
