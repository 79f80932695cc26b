"""Union-Rect programs: what is fixed between rewrites, and the rectangles as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from d4cad.errors import GrammarError
from d4cad.program import Floats, Program

NUMBERS = 5
"""A rectangle's numbers: centre x, y, half-sizes along its own axes, angle of its own x axis."""


@dataclass(frozen=True, slots=True)
class Structure:
    """How many rectangles there are. Raises GrammarError if there is none."""

    count: int

    def __post_init__(self) -> None:
        if self.count < 1:
            raise GrammarError(f"a Union-Rect program has at least one rectangle, got {self.count}")

    @property
    def size(self) -> int:
        """Number of parameters."""
        return NUMBERS * self.count


def rects_of(program: Program[Structure]) -> Floats:
    """The rectangles, (n, 5) in world units and radians; half-sizes below 0 count as 0."""
    rects = program.params.reshape(program.structure.count, NUMBERS).copy()
    rects[:, 2:4] = np.maximum(rects[:, 2:4], 0.0)
    return rects


def program_of(rects: Floats) -> Program[Structure]:
    """The program of rectangles (n, 5)."""
    return Program(Structure(len(rects)), np.asarray(rects, dtype=np.float64).reshape(-1).copy())


def to_pixels(rects: Floats, scale: float, dx: float = 0.0, dy: float = 0.0) -> Floats:
    """Rectangles with world lengths times ``scale``, their centres then moved by (dx, dy)."""
    found = np.ascontiguousarray(rects, dtype=np.float64).copy()
    found[:, :4] *= scale
    found[:, :2] += (dx, dy)
    return found


def to_world(rects: Floats, scale: float, dx: float = 0.0, dy: float = 0.0) -> Floats:
    """The inverse of :func:`to_pixels`."""
    found = np.ascontiguousarray(rects, dtype=np.float64).copy()
    found[:, :2] -= (dx, dy)
    found[:, :4] /= scale
    return found


def corners(rects: Floats) -> Floats:
    """Corners of rectangles (n, 5) counter-clockwise, (n, 4, 2)."""
    rects = np.asarray(rects)
    cos, sin = np.cos(rects[:, 4, None]), np.sin(rects[:, 4, None])
    u = rects[:, 2, None] * np.array([1.0, 1.0, -1.0, -1.0])
    v = rects[:, 3, None] * np.array([-1.0, 1.0, 1.0, -1.0])
    return np.stack([rects[:, 0, None] + u * cos - v * sin, rects[:, 1, None] + u * sin + v * cos], axis=2)


def from_local(rect: Floats, u: float, v: float) -> tuple[float, float]:
    """The world point of local coordinates (u, v) of a rectangle (5,)."""
    cos, sin = np.cos(rect[4]), np.sin(rect[4])
    return float(rect[0] + u * cos - v * sin), float(rect[1] + u * sin + v * cos)


def to_local(rect: Floats, points: Floats) -> Floats:
    """World points (k, 2) in the local coordinates of a rectangle (5,)."""
    cos, sin = np.cos(rect[4]), np.sin(rect[4])
    dx, dy = points[:, 0] - rect[0], points[:, 1] - rect[1]
    return np.stack([dx * cos + dy * sin, dy * cos - dx * sin], axis=1)


def part(rect: Floats, u0: float, u1: float, v0: float, v1: float) -> Floats:
    """The rectangle [u0, u1] x [v0, v1] in the local coordinates of another one."""
    x, y = from_local(rect, (u0 + u1) / 2, (v0 + v1) / 2)
    return np.array([x, y, (u1 - u0) / 2, (v1 - v0) / 2, rect[4]])


def angle_metric(program: Program[Structure]) -> Floats:
    """Steps (n,) per unit of gradient that amount to the paper's, which moves angle / pi (SPEC 2, "Scaling")."""
    metric = np.ones(program.structure.size)
    metric[4::NUMBERS] = np.pi**2
    return metric
