"""The design domain on a grid of elements, and the canvas on which programs are drawn over it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from d4cad.canvas import SPAN, Canvas
from d4cad.objectives.fem import PlaneStress
from d4cad.objectives.symmetry import Folded, Work
from d4cad.program import Floats

Bools = NDArray[np.bool_]

MARGIN = 4
"""Elements around the domain into which a program may reach: what lies there is cut off, so that the coverage of an
element at the domain's border does not depend on a ramp that the cut does not have."""

OUTSIDE = 1e-9
"""Stiffness of what is not part of the domain."""


@dataclass(frozen=True, eq=False)
class Domain:
    """inside: (height, width) bool, elements of the domain. solid, void: those that are fixed. elastic: supports, loads
    and elements. volume: number of elements of material to use, fixed ones included. mirrored: whether the problem and
    so the design is its own mirror image (left to right, bottom to top): a program then draws the left or lower half.
    """

    inside: Bools
    solid: Bools
    void: Bools
    elastic: PlaneStress
    volume: float
    mirrored: tuple[bool, bool] = (False, False)
    margin: int = MARGIN

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) in elements."""
        return self.inside.shape[0], self.inside.shape[1]

    @property
    def free(self) -> Bools:
        """Elements whose material is designed."""
        return np.asarray(self.inside & ~self.solid & ~self.void)

    @property
    def free_fraction(self) -> float:
        """The share of the free elements that the volume leaves for them."""
        return float((self.volume - self.solid.sum()) / self.free.sum())

    def clamped(self, density: Floats) -> Floats:
        """The density with the fixed elements as they must be, (height, width)."""
        return np.where(self.solid, 1.0, np.where(self.free, density, 0.0))

    def young(self, stiffness: Floats) -> Floats:
        """Stiffnesses with those outside of the domain at their least, (height, width)."""
        return np.where(self.inside, stiffness, OUTSIDE)

    @cached_property
    def _folded(self) -> Folded:
        return Folded.of(self.elastic, self.mirrored)

    def work(self, stiffness: Floats) -> Work:
        """What the loads do to stiffnesses (height, width) as symmetric as the domain; those outside do not count."""
        return self._folded.solve(self.young(stiffness))

    @property
    def drawn(self) -> tuple[int, int]:
        """(height, width) in elements of the part of the domain that a program draws: a half where it is mirrored."""
        (height, width), (x, y) = self.shape, self.mirrored
        return height // 2 if y else height, width // 2 if x else width

    @property
    def canvas(self) -> Canvas:
        """One pixel an element, ``margin`` pixels around what is drawn, the ramp one element to either side."""
        height, width = (side + 2 * self.margin for side in self.drawn)
        return Canvas(width, height, SPAN / max(width, height), ramp=1.0)

    def unfolded(self, coverage: Floats) -> Floats:
        """The domain's density (height, width) from a canvas' coverage."""
        part = coverage[self.margin : -self.margin, self.margin : -self.margin]
        if self.mirrored[0]:
            part = np.concatenate([part, part[:, ::-1]], axis=1)
        if self.mirrored[1]:
            part = np.concatenate([part, part[::-1]], axis=0)
        return self.clamped(part)

    def folded(self, gradient: Floats) -> Floats:
        """The transpose of :meth:`unfolded`: a gradient by density (height, width) as one by coverage on the canvas."""
        part = np.where(self.free, gradient, 0.0)
        height, width = self.drawn
        if self.mirrored[1]:
            part = part[:height] + part[height:][::-1]
        if self.mirrored[0]:
            part = part[:, :width] + part[:, width:][:, ::-1]
        return np.pad(part, self.margin)
