"""What every dialect writes: named parameters, and named contours of features or of edges."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import copysign, floor, hypot, log10, sqrt

from d4cad.exporters.occ import CAUTIOUS, CONFUSION, FLATTEST, require_mm, require_thickness
from d4cad.exporters.source.linear import Linear
from d4cad.exporters.source.parameters import Named, Names, Parameter, named
from d4cad.exporters.source.places import Place, center, exact, middle
from d4cad.exporters.source.shared import Shared, shared
from d4cad.exporters.source.told import told
from d4cad.exporters.source.words import at, described, edges, number, ranges, short
from d4cad.features import TOLERANCE, Circle, Feature, feature
from d4cad.loop import ROUNDING, Loop, Point
from d4cad.sketch import Sketch

DECIMALS = 9
"""Decimals of a coordinate in mm of a part of 1 mm or more; smaller parts have as many significant digits."""

LARGEST = 0.9
"""Bulge of arcs whose radius is written: the chord of major arcs and near semicircles says little about theirs."""

UNSEEN = 1e-9
"""Share of the part's area that an arc may lose by becoming a line where the kernel would find it invalid."""


@dataclass(frozen=True, slots=True)
class Piece:
    """Consecutive lines through ``points``, or one arc from the first point over ``middle`` to the last.

    ``bulge``: of the arc. ``radius``: of an arc for which a short number is as exact as three points are, signed as
    its bulge: > 0 counter-clockwise; its magnitude may be a parameter, ``radius_name``, and then ``center`` is what the
    arc's centre is computed from. ``bent``: whether the chord depends on parameters in such a way that the middle is
    best computed from the ends.
    """

    points: tuple[Point, ...]
    middle: Point | None = None
    bulge: float = 0.0
    radius: float | None = None
    radius_name: str = ""
    center: Place | None = None
    bent: bool = False


@dataclass(frozen=True, slots=True)
class Contour:
    """One closed curve. ``name``: outer_1, hole_1 ... ``what``: kind and size, for people.

    ``feature``: what it is called, if it has a name, and ``names``: the parameters that hold its sizes.
    ``pieces``: its edges if it has no name; lines come first if there are any. ``relations``: what holds between them.
    """

    name: str
    what: str
    feature: Feature | None = None
    names: Names = field(default_factory=dict)
    pieces: tuple[Piece, ...] = ()
    relations: str = ""

    @property
    def comments(self) -> list[str]:
        """Its name in words and what it is, and the relations of its edges."""
        return [f"{self.name.replace('_', ' ')}: {self.what}", *([self.relations] if self.relations else [])]


@dataclass(frozen=True, slots=True)
class Face:
    """One connected region."""

    outer: Contour
    holes: tuple[Contour, ...]

    @property
    def contours(self) -> tuple[Contour, ...]:
        """The outer one, then the holes."""
        return (self.outer, *self.holes)

    @property
    def families(self) -> list[Family]:
        """The contours in order, circles that share their diameter together at the first one's place."""
        families: dict[str, list[Contour]] = {}
        for contour in self.contours:
            families.setdefault(contour.names.get("diameter", contour.name), []).append(contour)
        return [Family(tuple(members), subtracted=members[0] is not self.outer) for members in families.values()]


@dataclass(frozen=True, slots=True)
class Family:
    """Contours that differ in place only, so that one call makes them all. ``subtracted``: they are holes."""

    members: tuple[Contour, ...]
    subtracted: bool

    @property
    def first(self) -> Contour:
        """The one that stands for all."""
        return self.members[0]

    @property
    def comments(self) -> list[str]:
        """Names in words, and what they are."""
        if len(self.members) == 1:
            return self.first.comments
        numbers = [int(member.name.rpartition("_")[2]) for member in self.members]
        kind = self.first.what.partition(" at ")[0].replace("circle", "circles", 1)
        return [f"{self.first.name.partition('_')[0]}s {ranges(numbers)}: {kind}"]


@dataclass(frozen=True, slots=True)
class Plan:
    """A part as it will be written.

    ``parameters``: those of the whole part, thickness and scale. ``dimensions``: those of its contours. ``formulas``:
    what follows from them. ``relations``: what holds between contours, for comments. ``faces``: one comes before those
    that lie in its holes. ``edges``: what the part is made of, for people. ``decimals``: of every coordinate.
    ``places``: the points that are computed.
    """

    parameters: tuple[Parameter, ...]
    dimensions: tuple[Parameter, ...]
    formulas: tuple[Parameter, ...]
    relations: tuple[str, ...]
    faces: tuple[Face, ...]
    edges: str
    decimals: int
    places: Mapping[Point, Place]

    @property
    def has_bent_arcs(self) -> bool:
        """Whether there is an arc whose middle is computed from its ends."""
        return any(piece.bent for contour in self.contours for piece in contour.pieces)

    @property
    def contours(self) -> tuple[Contour, ...]:
        """Those of all faces."""
        return tuple(contour for face in self.faces for contour in face.contours)

    def number(self, value: float) -> str:
        """A coordinate or size, as short as its decimals allow."""
        return number(value, self.decimals)

    def place(self, point: Point) -> Place:
        """x and y of a point: numbers, or how they are computed."""
        return self.places.get(point) or (Linear(point[0]), Linear(point[1]))

    def radius(self, piece: Piece, *, sign: int) -> str:
        """The radius of an arc that has one: a number or a parameter. sign: 1 as it is, -1 negated, 0 its magnitude."""
        radius = piece.radius or 0.0
        signed = abs(radius) if sign == 0 else sign * radius
        return ("-" if signed < 0 else "") + (piece.radius_name or self.number(abs(radius)))


def plan(sketch: Sketch, thickness: float, scale: float = 1.0) -> Plan:
    """The plan of a sketch in mm, extruded by ``thickness`` mm. ``scale``: mm that one unit of it becomes.

    Raises InputError for a bad thickness, a sketch that is empty or not in mm, or sizes that no solid has, and
    GeometryError for a scale that is not positive and finite.
    """
    height = require_thickness(thickness)
    require_mm(sketch)
    require_mm(sketch.scaled(scale))
    xmin, ymin, xmax, ymax = sketch.bounds
    decimals = DECIMALS + max(0, -floor(log10(max(xmax - xmin, ymax - ymin))))
    indexed = iter(enumerate(sketch.loops))
    numbered = [(face, [next(indexed) for _ in face.loops]) for face in sketch.faces]
    numbered.sort(key=lambda entry: -entry[0].outer.area)  # what lies in a hole is smaller than its face
    numbers = iter(range(1, len(sketch.loops) + 1))
    faces, found = [], dict[int, Contour]()
    for k, (_, (outer, *holes)) in enumerate(numbered, 1):
        named_loops = [(f"outer_{k}", *outer), *((f"hole_{next(numbers)}", *hole) for hole in holes)]
        found |= {index: _contour(name, loop, sketch.area, decimals) for name, index, loop in named_loops}
        faces.append([index for _, index, _ in named_loops])
    contours = [found[index] for face in faces for index in face]
    common = _shared(sketch, found, decimals)
    centers = {found[index].name: (x.text(decimals), y.text(decimals)) for index, (x, y) in common.centers.items()}
    features = [Named(c.name, c.feature) for c in contours if c.feature is not None]
    dimensions, names = named(features, decimals, centers)
    within, between = told(sketch, {index: contour.name for index, contour in found.items()})
    places = dict(common.points)
    for index, contour in found.items():
        found[index] = replace(
            contour,
            names=names.get(contour.name, {}),
            pieces=tuple(_computed(piece, common, places) for piece in contour.pieces),
            relations=within.get(index, "") if contour.feature is None else "",
        )
    parameters = (
        Parameter("thickness", height, "mm"),
        Parameter("scale", float(scale), "mm per drawing unit, in the plane"),
    )
    made = tuple(Face(found[outer], tuple(found[hole] for hole in holes)) for outer, *holes in faces)
    return Plan(
        parameters,
        (*common.parameters, *dimensions),
        common.formulas,
        between,
        made,
        edges(*_census(contours)),
        decimals,
        places,
    )


def _shared(sketch: Sketch, found: Mapping[int, Contour], decimals: int) -> Shared:
    """The coordinates that contours of edges and circles share."""
    rings = {k: contour.feature.center for k, contour in found.items() if isinstance(contour.feature, Circle)}
    names = {k: contour.name for k, contour in found.items() if contour.feature is None or k in rings}
    return shared(sketch, names, rings, decimals)


def _computed(piece: Piece, common: Shared, places: dict[Point, Place]) -> Piece:
    """The piece, its middle among the ``places`` and without a radius of its own, if its ends depend on parameters."""
    if piece.middle is None:
        return piece
    ends = piece.points[0], piece.points[-1]
    start, end = map(common.place, ends)
    name = common.radii.get(ends, "")
    bulge = exact(piece.bulge)
    between = middle(start, end, bulge)
    if between[0].terms or between[1].terms:
        places[piece.middle] = between
    if name:
        radius = copysign(hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]) / sqrt(2), bulge)
        return replace(piece, radius=radius, radius_name=name, center=center(start, end, bulge))
    moves = any((end[axis] - start[axis]).terms for axis in (0, 1))
    return replace(piece, radius=None, bent=abs(bulge) != 1) if moves else piece


def _contour(name: str, loop: Loop, area: float, decimals: int) -> Contour:
    xmin, ymin, xmax, ymax = loop.bounds
    shorter = min(xmax - xmin, ymax - ymin)
    found = feature(loop, max(ROUNDING * loop.extent, TOLERANCE * min(1.0, 0.1 * shorter)))
    if found is not None:
        return Contour(name, described(found), found)
    pieces = _pieces(loop, area, decimals)
    size = f"{short(xmax - xmin)} x {short(ymax - ymin)} mm"
    place = at(((xmin + xmax) / 2, (ymin + ymax) / 2))
    contour = Contour(name, "", pieces=pieces)
    return replace(contour, what=f"contour, {size} {place}, {edges(*_census([contour]))}")


def _pieces(loop: Loop, area: float, decimals: int) -> tuple[Piece, ...]:
    """Runs of lines, and arcs, all the way round; the first begins a run that has an arc before it, if there is one."""
    n = len(loop.points)
    single = [_piece(loop.points[i], loop.points[(i + 1) % n], loop.bulges[i], area, decimals) for i in range(n)]
    first = next((i for i in range(n) if single[i].middle is None and single[i - 1].middle is not None), 0)
    pieces: list[Piece] = []
    for piece in single[first:] + single[:first]:
        if pieces and piece.middle is None and pieces[-1].middle is None:
            pieces[-1] = Piece((*pieces[-1].points, piece.points[1]))
        else:
            pieces.append(piece)
    return tuple(pieces)


def _piece(start: Point, end: Point, bulge: float, area: float, decimals: int) -> Piece:
    (x0, y0), (x1, y1) = start, end
    chord = hypot(x1 - x0, y1 - y0)
    if bulge == 0 or _is_flat(chord, abs(bulge), area):
        return Piece((start, end))
    middle = ((x0 + x1) / 2 + bulge * (y1 - y0) / 2, (y0 + y1) / 2 - bulge * (x1 - x0) / 2)
    return Piece((start, end), middle, bulge, _short_radius(chord, bulge, decimals))


def _is_flat(chord: float, bulge: float, area: float) -> bool:
    """Whether kernels take the arc for a line, or are known to stumble over it while nobody would see the line."""
    radius, sagitta = chord * (1 + bulge * bulge) / (4 * bulge), chord * bulge / 2
    return sagitta < CONFUSION or radius > FLATTEST or (radius > CAUTIOUS and sagitta * chord < UNSEEN * area)


def _short_radius(chord: float, bulge: float, decimals: int) -> float | None:
    """The signed radius if, three decimals shorter than coordinates are, it still puts the arc's middle as exactly.

    Arcs of more than LARGEST are better told by three points.
    """
    if abs(bulge) > LARGEST:
        return None
    radius = round(chord * (1 + bulge * bulge) / (4 * abs(bulge)), decimals - 3)
    if radius <= chord / 2:
        return None
    sagitta = radius - sqrt(radius * radius - chord * chord / 4)
    if abs(sagitta - abs(bulge) * chord / 2) > 10.0**-decimals:
        return None
    return radius if bulge > 0 else -radius


def _census(contours: Iterable[Contour]) -> tuple[int, int, int]:
    """How many lines, arcs and full circles."""
    kinds = [kind for contour in contours for kind in _kinds(contour)]
    return kinds.count("line"), kinds.count("arc"), kinds.count("circle")


def _kinds(contour: Contour) -> Iterator[str]:
    match contour.feature:
        case Circle():
            yield "circle"
        case None:
            for piece in contour.pieces:
                yield from ["line"] * (len(piece.points) - 1) if piece.middle is None else ["arc"]
        case found:
            yield from ("line" if b == 0 else "arc" for b in found.loop().bulges)
