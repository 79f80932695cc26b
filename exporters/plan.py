"""What a form is made of: columns of material added, taken away, and edges rounded. Geometry only, no kernel.

Everything that does not fit is refused here, with the value that would: a kernel would fail later and say less.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import cos, floor, log10
from typing import Any

import numpy as np

from d4cad.errors import GeometryError, InputError
from d4cad.exporters.form import Chamfer, Emboss, Engrave, Fillet, Form, Pocket, Shell
from d4cad.exporters.inset import inset, moved, normals
from d4cad.exporters.occ import require_mm, require_thickness
from d4cad.loop import Loop
from d4cad.offsets import offset
from d4cad.sketch import Face, Sketch

NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)
"""Gauss-Legendre rule on [-1, 1]."""

TANGENT = 1e-4
"""Radians of a corner below which its edges are tangent."""

Profile = tuple[tuple[float, float], ...]
"""(height, inset) in mm, rising: how far the outline has moved into the material at some heights; linear between."""


@dataclass(frozen=True, slots=True)
class Slab:
    """A prism with leaning walls from ``bottom`` to ``top``, its edges moving inwards by ``slope`` mm per mm upwards.

    ``sketch``: its section at ``level``, which is bottom or top.
    """

    sketch: Sketch
    level: float
    bottom: float
    top: float
    slope: float

    @property
    def volume(self) -> float:
        """mm^3, exact."""
        height = self.top - self.bottom
        if not self.slope:
            return self.sketch.area * height
        away = self.slope if self.level == self.bottom else -self.slope
        return _integral(lambda z: _area(self.sketch, away * z), height)


@dataclass(frozen=True, slots=True)
class Column:
    """Slabs on top of each other, the sections of one ``sketch``."""

    sketch: Sketch
    profile: Profile

    @property
    def slabs(self) -> Iterator[Slab]:
        """From the lowest to the highest."""
        for (low, first), (high, last) in zip(self.profile, self.profile[1:], strict=False):
            # the section nearer to the outline, so that slabs that touch there have the very same edges
            level, distance = (high, last) if abs(last) < abs(first) else (low, first)
            yield Slab(inset(self.sketch, distance), level, low, high, (last - first) / (high - low))

    @property
    def sections(self) -> list[tuple[Loop, ...]]:
        """The loops at every height of the profile."""
        return [tuple(moved(loop, distance) for loop in self.sketch.loops) for _, distance in self.profile]

    @property
    def volume(self) -> float:
        """mm^3, exact."""
        return sum(slab.volume for slab in self.slabs)


@dataclass(frozen=True, slots=True)
class Rounding:
    """Fillets along all edges of the faces at height ``level``, where ``sketch`` is the section with sharp edges.

    ``slope``: of the walls, inwards towards that face.
    """

    sketch: Sketch
    level: float
    slope: float
    fillet: Fillet

    @property
    def volume(self) -> float:
        """mm^3 that it takes away, exact where the kernel prolongs fillets to sharp mitres at the corners."""
        depth = self.fillet.reach(self.slope)[1]

        def removed(level: float) -> float:
            return _area(self.sketch, -self.slope * level) - _area(self.sketch, self.fillet.inset(level, self.slope))

        # level = depth s^2: the section changes like the square root of the level
        return _integral(lambda s: removed(depth * s * s) * 2 * depth * s, 1.0)


@dataclass(frozen=True, slots=True)
class Plan:
    """``add`` less ``cut``, then rounded, then less ``hollow``. No two columns of one kind share volume."""

    add: tuple[Column, ...]
    cut: tuple[Column, ...] = ()
    roundings: tuple[Rounding, ...] = ()
    hollow: tuple[Column, ...] = ()


def plan(sketch: Sketch, thickness: float, form: Form, chord: float | None = None) -> Plan:
    """The columns of a form of the sketch (mm) that is not revolved; plain parts are from z = 0 to ``thickness`` mm.

    ``chord``: mm; with one, fillets are polygons within it and part of the columns, without one they are roundings.
    Raises InputError, one sentence with the value that would fit, where the form does not fit the sketch.
    """
    require_mm(sketch)
    if form.relief is not None:
        return _relief(sketch, form.relief, thickness)
    return _extruded(sketch, require_thickness(thickness), form, chord)


def _relief(sketch: Sketch, relief: Emboss | Engrave, thickness: float) -> Plan:
    base = require_thickness(thickness if relief.base is None else relief.base)
    xmin, ymin, xmax, ymax = sketch.bounds
    m = relief.margin
    corners = [(xmin - m, ymin - m), (xmax + m, ymin - m), (xmax + m, ymax + m), (xmin - m, ymax + m)]
    plate = _upright(Sketch((Face(Loop.polyline(corners)),), "mm"), 0.0, base)
    if isinstance(relief, Emboss):
        return Plan((plate, _upright(sketch, base, base + require_thickness(relief.height))))
    if relief.depth >= base:
        raise InputError(f"the engraving of {relief.depth:g} mm goes through its base plate of {base:g} mm")
    return Plan((plate,), (_upright(sketch, base - require_thickness(relief.depth), base),))


def _upright(sketch: Sketch, bottom: float, top: float) -> Column:
    return Column(sketch, ((bottom, 0.0), (top, 0.0)))


def _extruded(sketch: Sketch, height: float, form: Form, chord: float | None) -> Plan:
    slope = form.slope
    summit = _drafted(sketch, height, form)
    depths = _depths(sketch, form.pockets)
    for depth in depths.values():
        if depth >= height:
            raise InputError(
                f"the pocket of {depth:g} mm goes through the part of {height:g} mm: leave it out for a through hole"
            )
    floors = {_pocket(sketch, hole): depth for hole, depth in depths.items()}
    ground = _without(sketch, floors)
    rim = form.rim
    if isinstance(rim, Fillet) and slope and chord is None:
        _require_tame_corners(sketch)
    top = rim if rim is not None and rim.edges != "bottom" else None
    bottom = rim if rim is not None and rim.edges != "top" else None
    if rim is not None:
        _require_room(rim, top, bottom, height, slope, list(depths.values()), form.shell)
    if top is not None:
        _require_inset(summit, top, slope)
    if bottom is not None:
        _require_inset(ground, bottom, -slope)
    low, high = _bevel(bottom, -slope, chord), _bevel(top, slope, chord)
    body = Column(ground, _profile(0.0, height, slope, low, high))
    cut = tuple(
        Column(Sketch((tool,), "mm"), tuple((z, -d) for z, d in _profile(height - depth, height, slope, [], high)))
        for tool, depth in floors.items()
    )
    roundings = []
    if isinstance(top, Fillet) and chord is None:
        roundings.append(Rounding(summit, height, slope, top))
    if isinstance(bottom, Fillet) and chord is None:
        roundings.append(Rounding(ground, 0.0, -slope, bottom))
    hollow = () if form.shell is None else (_hollow(ground, height, form, form.shell),)
    return Plan((body,), cut, tuple(roundings), hollow)


def _bevel(rim: Fillet | Chamfer | None, slope: float, chord: float | None) -> Sequence[tuple[float, float]]:
    """(inset, level) of a rim that is part of the columns."""
    if isinstance(rim, Chamfer):
        return rim.points(slope, 0.0)
    return [] if rim is None or chord is None else rim.points(slope, chord)


def _profile(
    low: float,
    high: float,
    slope: float,
    bottom: Sequence[tuple[float, float]],
    top: Sequence[tuple[float, float]],
) -> Profile:
    """Of walls that lean by ``slope`` from z = 0 on, between two heights, with bevels (inset, level) at the ends."""
    start = [(low + level, slope * low + found) for found, level in bottom] or [(low, slope * low)]
    end = [(high - level, slope * high + found) for found, level in reversed(top)] or [(high, slope * high)]
    return (*start, *end)


def _drafted(sketch: Sketch, height: float, form: Form) -> Sketch:
    """The section at the top."""
    try:
        return inset(sketch, height * form.slope)
    except GeometryError as error:
        degrees = form.draft * 180 / np.pi
        most = _largest(lambda share: inset(sketch, height * np.tan(form.draft * share)), degrees)
        raise InputError(
            f"the draft of {degrees:g} degrees does not fit over {height:g} mm: {error}; {_room(most, 'degrees')}"
        ) from None


def _require_inset(section: Sketch, rim: Fillet | Chamfer, slope: float) -> None:
    inwards = rim.reach(slope)[0]
    try:
        inset(section, inwards)
    except GeometryError as error:
        most = _largest(lambda share: inset(section, inwards * share), rim.size)
        raise InputError(f"{rim_name(rim)} does not fit: {error}; {_room(most, 'mm')}") from None


def _require_tame_corners(sketch: Sketch) -> None:
    """Raises InputError where an arc meets its neighbour at an angle.

    Drafted walls meet there in a parabola, along which OpenCASCADE's fillets go wrong: it has crashed on some.
    """
    for loop in sketch.loops:
        e = loop.edges
        before = e.take(np.roll(np.arange(e.b.size), 1))
        turn = np.abs(np.angle(normals(e, e.z0) / normals(before, e.z0)))
        bad = (turn > TANGENT) & ((e.b != 0) | (before.b != 0))
        if np.any(bad):
            z = e.z0[int(np.argmax(bad))]
            raise InputError(
                "the kernel cannot round drafted walls where an arc meets an edge at an angle,"
                f" as at ({z.real:g}, {z.imag:g}) mm: take a chamfer, or no draft"
            )


def _require_room(
    rim: Fillet | Chamfer,
    top: Fillet | Chamfer | None,
    bottom: Fillet | Chamfer | None,
    height: float,
    slope: float,
    depths: Sequence[float],
    shell: Shell | None,
) -> None:
    """Raises InputError where a rim takes all of a wall's height, a floor's thickness or a shell's wall."""
    down = 0.0 if top is None else top.reach(slope)[1]
    up = 0.0 if bottom is None else bottom.reach(-slope)[1]
    rooms = [(down + up, height, f"the thickness of {height:g} mm")]
    if depths and top is not None:
        rooms.append((down, min(depths), f"a pocket of {min(depths):g} mm"))
    if depths and bottom is not None:
        rooms.append((up, height - max(depths), f"the floor of {height - max(depths):g} mm under a pocket"))
    if shell is not None:
        widest = max(*rim.reach(slope), *rim.reach(-slope)) if slope else rim.size
        rooms.append((widest, shell.wall, f"walls of {shell.wall:g} mm"))
    for taken, room, name in rooms:
        if taken >= room:
            raise InputError(
                f"{rim_name(rim)} does not fit {name}: a size of less than {_short(rim.size * room / taken)} mm does"
            )


def rim_name(rim: Fillet | Chamfer) -> str:
    """As error messages call it: "the fillet of 2 mm"."""
    return f"the {'fillet' if isinstance(rim, Fillet) else 'chamfer'} of {rim.size:g} mm"


def _hollow(ground: Sketch, height: float, form: Form, shell: Shell) -> Column:
    wall = require_thickness(shell.wall)
    if wall >= height:
        raise InputError(f"the shell of {wall:g} mm leaves no hollow in a part {height:g} mm thick")
    low, high = (wall, height) if shell.open == "top" else (0.0, height - wall)
    try:
        inside = _left(inset(ground, low * form.slope), wall / cos(form.draft))
    except GeometryError as error:
        raise InputError(f"the shell of {wall:g} mm leaves no hollow in this outline: {error}") from None
    try:
        inset(inside, (high - low) * form.slope)
    except GeometryError as error:
        raise InputError(f"the shell of {wall:g} mm does not fit drafted walls: {error}") from None
    return Column(inside, ((low, 0.0), (high, (high - low) * form.slope)))


def _left(sketch: Sketch, wall: float) -> Sketch:
    """What is further than a wall from the edges: with their sharp corners where every edge lives on, else rounded."""
    try:
        return inset(sketch, wall)
    except GeometryError:
        left = offset(sketch, -wall)
    if not left.faces:
        raise GeometryError(f"no part of it is {wall:g} mm from its edges")
    return left


def _depths(sketch: Sketch, pockets: Sequence[Pocket]) -> dict[int, float]:
    """Depth by the number of the hole."""
    starts = np.cumsum([0, *(len(face.loops) for face in sketch.faces)])[:-1].tolist()
    holes = [k for k in range(len(sketch.loops)) if k not in starts]
    if pockets and not holes:
        raise InputError("a pocket needs a hole, and this part has none")
    depths: dict[int, float] = {}
    for pocket in sorted(pockets, key=lambda p: p.hole is not None):
        if pocket.hole is not None and pocket.hole not in holes:
            known = ", ".join(map(str, holes))
            raise InputError(f"loop {pocket.hole} is no hole that could be a pocket: the holes are {known}")
        for hole in holes if pocket.hole is None else [pocket.hole]:
            depths[hole] = pocket.depth
    return depths


def _pocket(sketch: Sketch, hole: int) -> Face:
    """The region of a hole less the islands in it."""
    outline = sketch.loops[hole].oriented()
    inner = [loop for loop in sketch.loops if loop.oriented() != outline and outline.contains(_first(loop))[0]]
    return next(face for face in Sketch.from_loops([outline, *inner], "mm").faces if face.outer == outline)


def _first(loop: Loop) -> Any:
    return np.array(loop.points[:1])


def _without(sketch: Sketch, tools: dict[Face, float]) -> Sketch:
    """What stands on z = 0: pockets are filled, and the islands in them are part of their floor."""
    filled = {loop.oriented() for tool in tools for loop in tool.loops}
    if not filled:
        return sketch
    return Sketch.from_loops([loop for loop in sketch.loops if loop.oriented() not in filled], "mm")


def _area(sketch: Sketch, distance: float) -> float:
    return sum(moved(loop, distance).area for loop in sketch.loops)


def _integral(f: Callable[[float], float], length: float) -> float:
    """Of a smooth function from 0 to ``length``."""
    at = (NODES + 1) / 2 * length
    return float(sum(w * f(float(x)) for x, w in zip(at, WEIGHTS, strict=True)) * length / 2)


def _largest(attempt: Callable[[float], object], value: float) -> float:
    """The largest share of ``value``, to 0.1%, for which ``attempt(share)`` raises no GeometryError; 0 if none does."""
    low, high = 0.0, 1.0
    for _ in range(10):
        share = (low + high) / 2
        try:
            attempt(share)
            low = share
        except GeometryError:
            high = share
    return low * value


def _room(most: float, unit: str) -> str:
    return f"up to about {_short(most)} {unit} fits" if most else "hardly any fits this outline"


def _short(value: float) -> str:
    """Three digits, rounded towards zero, so that what is promised does fit."""
    if value == 0:
        return "0"
    digit = 10.0 ** (floor(log10(abs(value))) - 2)
    return f"{(floor(abs(value) / digit + 1e-9) * digit) * (1 if value > 0 else -1):.12g}"
