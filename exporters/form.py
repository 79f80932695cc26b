"""How an outline becomes a solid: extruded by default, with pockets, draft, rim and shell; raised, cut in, or revolved.

Lengths in mm, angles in radians. Values only: what is asked for, checked on its own. Whether it fits a sketch is
known where the sketch is (solids.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan, ceil, cos, isfinite, pi, radians, sin, sqrt, tan

from d4cad.errors import InputError

STEEPEST = radians(60)
"""Largest draft angle: beyond it is no draft but a roof."""
LEAST_DRAFT = radians(0.01) * (1 - 1e-9)
"""Smaller ones are lost in the CAD kernel's tolerances."""

WHERE = ("top", "bottom", "both")
OPEN = ("top", "bottom")
AXES = ("origin", "left")


@dataclass(frozen=True, slots=True)
class Pocket:
    """A hole that goes only ``depth`` mm down from the top. ``hole``: its place in `Sketch.loops`; None is every hole.

    Islands in the hole stand on the pocket's floor.
    """

    depth: float
    hole: int | None = None

    def __post_init__(self) -> None:
        _positive("depth of a pocket", self.depth)
        if self.hole is not None and self.hole < 0:
            raise InputError(f"a pocket's hole is the number of a loop from 0 on, got {self.hole}")


@dataclass(frozen=True, slots=True)
class Emboss:
    """The outline raised by ``height`` mm on a base plate: the bounding box and ``margin`` mm on every side.

    ``base``: the plate's thickness in mm; None is the part's thickness.
    """

    height: float
    base: float | None = None
    margin: float = 5.0

    def __post_init__(self) -> None:
        _positive("height of an embossing", self.height)
        _plate(self.base, self.margin)


@dataclass(frozen=True, slots=True)
class Engrave:
    """The outline cut ``depth`` mm into the top of a base plate as in :class:`Emboss`."""

    depth: float
    base: float | None = None
    margin: float = 5.0

    def __post_init__(self) -> None:
        _positive("depth of an engraving", self.depth)
        _plate(self.base, self.margin)


@dataclass(frozen=True, slots=True)
class Fillet:
    """A rounded rim of radius ``size`` mm along the edges of the "top", the "bottom" or "both"."""

    size: float
    edges: str = "top"

    def __post_init__(self) -> None:
        _positive("radius of a fillet", self.size)
        _one_of("edges of a fillet", self.edges, WHERE)

    def reach(self, slope: float) -> tuple[float, float]:
        """How far from the sharp edge it begins, in mm: inwards on the face, and across the face's level on the wall.

        ``slope``: tangent of the angle by which the wall leans inwards towards the face.
        """
        angle = atan(slope)
        return self.size * (1 / cos(angle) - slope), self.size * (1 - slope * cos(angle))

    def inset(self, level: float, slope: float) -> float:
        """Distance in mm of its section from the sharp edge, inwards, ``level`` mm from the face."""
        return self.reach(slope)[0] - sqrt(max(self.size**2 - (self.size - level) ** 2, 0.0))

    def points(self, slope: float, chord: float) -> list[tuple[float, float]]:
        """(inset, level) in mm from the face to the wall, as a polygon within ``chord`` mm of the arc."""
        turn = pi / 2 - atan(slope)
        count = max(2, ceil(turn / sqrt(8 * min(chord / self.size, 0.1))))
        inwards, angles = self.reach(slope)[0], [turn * k / count for k in range(count + 1)]
        return [(inwards - self.size * sin(t), self.size * (1 - cos(t))) for t in angles]


@dataclass(frozen=True, slots=True)
class Chamfer:
    """A bevel that takes ``size`` mm off both the face and the wall along the edges "top", "bottom" or "both"."""

    size: float
    edges: str = "top"

    def __post_init__(self) -> None:
        _positive("size of a chamfer", self.size)
        _one_of("edges of a chamfer", self.edges, WHERE)

    def reach(self, slope: float) -> tuple[float, float]:
        """As :meth:`Fillet.reach`."""
        return self.size, self.size * cos(atan(slope))

    def inset(self, level: float, slope: float) -> float:
        """As :meth:`Fillet.inset`."""
        inwards, down = self.reach(slope)
        return inwards - (inwards + slope * down) * level / down

    def points(self, slope: float, chord: float) -> list[tuple[float, float]]:
        """As :meth:`Fillet.points`; exact whatever the ``chord``."""
        inwards, down = self.reach(slope)
        return [(inwards, 0.0), (-slope * down, down)]


@dataclass(frozen=True, slots=True)
class Shell:
    """Hollow, with walls and a floor of ``wall`` mm, open at the "top" or the "bottom"."""

    wall: float
    open: str = "top"

    def __post_init__(self) -> None:
        _positive("wall of a shell", self.wall)
        _one_of("open side of a shell", self.open, OPEN)


@dataclass(frozen=True, slots=True)
class Revolve:
    """The outline as a half profile, turned by ``angle`` radians about its y axis, which becomes the part's z axis.

    ``axis``: "origin" is x = 0, "left" the profile's left edge. Turning starts in the plane y = 0, counter-clockwise
    as seen from above.
    """

    angle: float = 2 * pi
    axis: str = "origin"

    def __post_init__(self) -> None:
        if not 0 < self.angle <= 2 * pi * (1 + 1e-12):
            raise InputError(f"the angle of a revolution must be over 0 and at most 360 degrees, got {self.degrees:g}")
        _one_of("axis of a revolution", self.axis, AXES)

    @property
    def degrees(self) -> float:
        """The angle in degrees."""
        return self.angle * 180 / pi


@dataclass(frozen=True, slots=True)
class Form:
    """How an outline becomes a solid; the default is the plain extrude.

    ``pockets``: holes that are blind; one named by number wins over all. ``draft``: angle in radians by which the walls
    lean in from the outline at z = 0, so that the part narrows upwards and holes widen; negative leans out. ``rim``:
    Fillet or Chamfer of the top or bottom edges. ``shell``: hollow. ``relief``: Emboss or Engrave. ``revolve``: turned.
    Pockets, draft, rim and shell go together, except that a shell has no pockets; relief and revolve stand alone.
    Raises InputError for a number out of range or forms that exclude each other.
    """

    pockets: Sequence[Pocket] = ()
    draft: float = 0.0
    rim: Fillet | Chamfer | None = None
    shell: Shell | None = None
    relief: Emboss | Engrave | None = None
    revolve: Revolve | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "pockets", tuple(self.pockets))  # hashable, whatever sequence came
        if not abs(self.draft) <= STEEPEST:
            raise InputError(f"the draft must be from -60 to 60 degrees, got {self.draft * 180 / pi:g}")
        if 0 < abs(self.draft) < LEAST_DRAFT:
            raise InputError(f"a draft must be 0 or at least 0.01 degrees, got {self.draft * 180 / pi:g}")
        alone = "a revolution" if self.revolve else "an embossing or engraving" if self.relief else None
        if alone and self.names[1:]:
            raise InputError(f"{alone} cannot have other forms beside it, got {' and '.join(self.names)}")
        if self.shell and self.pockets:
            raise InputError("a shell has no pockets: expected one of the two")
        holes = [pocket.hole for pocket in self.pockets]
        for hole in holes:
            if holes.count(hole) > 1:
                raise InputError(f"the pocket {'all' if hole is None else hole} is given {holes.count(hole)} times")

    @property
    def names(self) -> tuple[str, ...]:
        """What differs from the plain extrude, in words."""
        return tuple(
            name
            for name, wanted in (
                ("revolve", self.revolve),
                ("emboss", isinstance(self.relief, Emboss)),
                ("engrave", isinstance(self.relief, Engrave)),
                ("pockets", self.pockets),
                ("draft", self.draft != 0),
                ("fillet", isinstance(self.rim, Fillet)),
                ("chamfer", isinstance(self.rim, Chamfer)),
                ("shell", self.shell),
            )
            if wanted
        )

    @property
    def needs_thickness(self) -> bool:
        """Whether the part's thickness has a say in the solid."""
        return self.revolve is None and (self.relief is None or self.relief.base is None)

    @property
    def slope(self) -> float:
        """mm by which the walls lean inwards per mm of height."""
        return tan(self.draft)


PLAIN = Form()
"""The plain extrude."""


def _positive(name: str, value: float) -> None:
    if not (isfinite(value) and value > 0):
        raise InputError(f"the {name} must be a positive number in mm, got {value:g}")


def _one_of(name: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise InputError(f"the {name} must be {', '.join(known[:-1])} or {known[-1]}, got {value!r}")


def _plate(base: float | None, margin: float) -> None:
    if base is not None:
        _positive("base of a relief", base)
    if not (isfinite(margin) and margin >= 0):
        raise InputError(f"the margin of a base plate must be 0 or more mm, got {margin:g}")
