"""Coordinates and radii that regularisation has made equal, as named parameters from which the points are computed.

Only what stays exact is named: the lines along x or y, the fillets and chamfers between two of them, the semicircles,
the centres of circles. Sweeps of arcs stay, so that the middle and the centre of an arc are linear in its ends.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import count
from math import copysign, pi, tan

from d4cad.exporters.source.linear import Linear
from d4cad.exporters.source.parameters import Parameter
from d4cad.exporters.source.words import contours, listed
from d4cad.loop import Loop, Point
from d4cad.relations import Dimension
from d4cad.sketch import Sketch

SAME = 1e-8
"""Share of the sketch's extent within which coordinates are equal: those that regularisation has made so are."""
QUARTER = tan(pi / 8)
BULGE = 1e-7
NAMES = re.compile(r"width|height|((corner|end|arc)_radius|length|distance)(_\d{1,4})?", re.ASCII)
"""Names that regularisation gives: any other might hide one that the source uses."""
LONGEST = 60
"""Characters of a formula beyond which nobody would have written it."""

SIDES = ("left", "right", "width", "bottom", "top", "height")
FIXED = {"right": 1, "top": 1, "left": 2, "bottom": 2}
"""Coordinates that stay parameters if another can follow from them, the greater the sooner."""
CENTERED = {"concentric": (0, 1), "horizontal": (1,), "vertical": (0,)}
"""Along which axes the centres are level in a relation between circular edges."""

Place = tuple[Linear, Linear]
Key = tuple[int, int, int]
"""Axis (0: x, 1: y), loop, and vertex, or CENTER."""
CENTER = -1


@dataclass(frozen=True, slots=True)
class Shared:
    """What points are computed from.

    parameters: numbers. formulas: parameters that follow from them. points: the vertices that depend on a parameter.
    radii: the parameter of an arc by its ends. centers: those of circles that depend on one, by index of the loop.
    """

    parameters: tuple[Parameter, ...] = ()
    formulas: tuple[Parameter, ...] = ()
    points: Mapping[Point, Place] = field(default_factory=dict)
    radii: Mapping[tuple[Point, Point], str] = field(default_factory=dict)
    centers: Mapping[int, Place] = field(default_factory=dict)

    def place(self, point: Point) -> Place:
        """A vertex, computed or as it is."""
        return self.points.get(point) or (Linear(point[0]), Linear(point[1]))


def middle(start: Place, end: Place, bulge: float) -> Place:
    """The point halfway along an arc that keeps its sweep."""
    (x0, y0), (x1, y1) = start, end
    return (
        (x0 + x1).times(0.5) + (y1 - y0).times(bulge / 2),
        (y0 + y1).times(0.5) + (x0 - x1).times(bulge / 2),
    )


def center(start: Place, end: Place, bulge: float) -> Place:
    """The centre of an arc that keeps its sweep, as ezdxf.math.bulge_center has it."""
    (x0, y0), (x1, y1) = start, end
    lift = (1 - bulge * bulge) / (4 * bulge)
    return (x0 + x1).times(0.5) + (y0 - y1).times(lift), (y0 + y1).times(0.5) + (x1 - x0).times(lift)


def shared(sketch: Sketch, names: Mapping[int, str], circles: Mapping[int, Point], decimals: int) -> Shared:
    """What the relations and dimensions of a sketch in mm let its points be computed from; nothing if there are none.

    names: what the loops are called whose points are written, by index: those of edges, and those of ``circles``, of
    which the centres are given. decimals: of the parameters. A relation that does not hold is passed over.
    """
    if not sketch.relations:
        return Shared()
    work = _Work(sketch, names, circles, decimals)
    work.align()
    work.round_corners()
    for dimension in sketch.dimensions:
        work.impose(dimension, centers=False)
    work.join_centers()
    for dimension in sketch.dimensions:
        work.impose(dimension, centers=True)
    return work.result()


@dataclass(eq=False)
class _Work:
    """What was found so far. values: of every parameter. formulas: of those that follow from the others. level: the
    edges along which a coordinate is the same.
    """

    sketch: Sketch
    names: Mapping[int, str]
    circles: Mapping[int, Point]
    decimals: int
    places: dict[Key, Linear] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)
    formulas: dict[str, Linear] = field(default_factory=dict)
    coordinates: list[str] = field(default_factory=list)
    radii: dict[tuple[Point, Point], str] = field(default_factory=dict)
    level: set[Key] = field(default_factory=set)

    @cached_property
    def loops(self) -> tuple[Loop, ...]:
        return self.sketch.loops

    @cached_property
    def slack(self) -> float:
        xmin, ymin, xmax, ymax = self.sketch.bounds
        return SAME * max(xmax - xmin, ymax - ymin)

    def at(self, key: Key) -> float:
        """A coordinate as it is."""
        axis, loop, vertex = key
        return (self.circles[loop] if vertex == CENTER else self.loops[loop].points[vertex])[axis]

    def expression(self, key: Key) -> Linear:
        """A coordinate as it is computed."""
        return self.places.get(key) or Linear(self.at(key))

    def vertex(self, loop: int, k: int) -> Place:
        return self.expression((0, loop, k)), self.expression((1, loop, k))

    def _equal(self, a: Key, b: Key) -> bool:
        return abs(self.at(a) - self.at(b)) <= self.slack

    def after(self, loop: int, k: int) -> int:
        return (k + 1) % len(self.loops[loop].points)

    def has_edges(self, loop: int) -> bool:
        return loop in self.names and loop not in self.circles

    def align(self) -> None:
        """Names the lines that run along an axis, and the places of semicircles between two of them."""
        groups = _Groups()
        for kind, axis in (("horizontal", 1), ("vertical", 0)):
            for relation in self.sketch.relations:
                if relation.kind == kind and len(relation.refs) == 1 and self.has_edges(relation.refs[0][0]):
                    loop, edge = relation.refs[0]
                    if self.loops[loop].bulges[edge] == 0:
                        groups.join((axis, loop, edge), (axis, loop, self.after(loop, edge)))
                        self.level.add((axis, loop, edge))
        for a, b in self._semicircles():
            groups.join(a, b)
        bounds = self.sketch.bounds
        sides = {0: {"left": bounds[0], "right": bounds[2]}, 1: {"bottom": bounds[1], "top": bounds[3]}}
        for axis in (0, 1):
            self._merge(groups, axis, tuple(sides[axis].values()))
            inner = count(1)
            for members in sorted(groups.of(axis), key=lambda group: self.at(group[0])):
                value = self.at(members[0])
                if all(self._equal(members[0], key) for key in members):
                    side = next((side for side, x in sides[axis].items() if abs(value - x) <= self.slack), None)
                    self._name(side or f"{'xy'[axis]}_{next(inner)}", members)

    def _semicircles(self) -> Iterator[tuple[Key, Key]]:
        """The coordinate that both ends of a semicircle between two parallel sides have."""
        for loop in filter(self.has_edges, self.names):
            bulges = self.loops[loop].bulges
            for k, bulge in enumerate(bulges):
                after = self.after(loop, k)
                for axis in (0, 1):
                    ends = (axis, loop, k), (axis, loop, after)
                    sides = {(1 - axis, loop, (k - 1) % len(bulges)), (1 - axis, loop, after)}
                    if abs(abs(bulge) - 1) <= BULGE and sides <= self.level and self._equal(*ends):
                        yield ends

    def _merge(self, groups: _Groups, axis: int, sides: Sequence[float]) -> None:
        """Joins the lines of one contour that are in line, and all that are at the same end of the sketch."""
        firsts = [members[0] for members in groups.of(axis)]
        for i, a in enumerate(firsts):
            for b in firsts[i + 1 :]:
                end = any(abs(self.at(a) - side) <= self.slack for side in sides)
                if self._equal(a, b) and (a[1] == b[1] or end):
                    groups.join(a, b)

    def _name(self, name: str, members: Sequence[Key], note: str = "") -> None:
        self.values[name] = round(sum(map(self.at, members)) / len(members), self.decimals) + 0.0
        self.notes[name] = note
        self.coordinates.append(name)
        for key in members:
            self.places[key] = Linear.of(name)

    def round_corners(self) -> None:
        """Computes the ends of fillets and chamfers from their corner, which two named lines have."""
        for dimension in self.sketch.dimensions:
            refs = [ref for ref in dimension.refs if self.has_edges(ref[0])]
            quarters = all(abs(abs(self.loops[loop].bulges[k]) - QUARTER) <= BULGE for loop, k in refs)
            if dimension.kind != "radius" or not (refs and quarters and NAMES.fullmatch(dimension.name)):
                continue
            corners = [self._setbacks(loop, k) for loop, k in refs]
            if all(corners) and self._cut(dimension.name, dimension.value, corners):
                for loop, k in refs:
                    points = self.loops[loop].points
                    self.radii[points[k], points[self.after(loop, k)]] = dimension.name
        chamfers: list[list[list[_Setback]]] = []
        for loop in filter(self.has_edges, self.names):
            for k, bulge in enumerate(self.loops[loop].bulges):
                corner = self._setbacks(loop, k) if bulge == 0 else []
                if not corner or abs(corner[0].size - corner[1].size) > self.slack:
                    continue
                same = next((g for g in chamfers if abs(g[0][0].size - corner[0].size) <= self.slack), None)
                if same is None:
                    chamfers.append([corner])
                else:
                    same.append(corner)
        for k, corners in enumerate(sorted(chamfers, key=lambda group: -group[0][0].size), 1):
            self._cut("chamfer" if len(chamfers) == 1 else f"chamfer_{k}", corners[0][0].size, corners)

    def _setbacks(self, loop: int, k: int) -> list[_Setback]:
        """Those of both ends of an edge between a level and an upright line; none of any other edge."""
        before, end = (k - 1) % len(self.loops[loop].points), self.after(loop, k)
        for axis in (0, 1):
            if (1 - axis, loop, before) in self.level and (axis, loop, end) in self.level:
                ways = ((axis, loop, k), (axis, loop, end)), ((1 - axis, loop, end), (1 - axis, loop, k))
                if all(corner in self.places and free not in self.places for free, corner in ways):
                    return [_Setback(free, corner, self.at(free) - self.at(corner)) for free, corner in ways]
        return []

    def _cut(self, name: str, size: float, corners: Sequence[Sequence[_Setback]]) -> bool:
        """Names the size by which corners are set back, unless it is not that of them all."""
        setbacks = [setback for corner in corners for setback in corner]
        if any(abs(setback.size - size) > self.slack for setback in setbacks):
            return False
        self.values[name] = round(size, self.decimals)
        for setback in setbacks:
            self.places[setback.free] = self.places[setback.corner] + Linear.of(name, copysign(1.0, setback.way))
        return True

    def impose(self, dimension: Dimension, *, centers: bool) -> None:
        """Makes a round size a parameter, and one of the coordinates that it fixes a formula; if one can be.

        ``centers``: sizes between centres, which have their names last, or all others.
        """
        name = dimension.name
        if name in self.values or not NAMES.fullmatch(name):
            return
        target = Linear.of(name, 2.0 if dimension.kind == "radius" else 1.0)
        formulas, places = dict(self.formulas), dict[Key, Linear]()
        spans = self._spans(dimension, centers=centers)
        for a, b in spans:
            if abs(self.at(b) - self.at(a) - target.value({name: dimension.value})) > self.slack:
                return
            start, end = (places.get(key) or self.expression(key) for key in (a, b))
            if not (start.terms or end.terms):
                return
            if not start.terms:
                places[a] = end - target
            elif not end.terms:
                places[b] = start + target
            elif not self._solved(end - start - target, formulas):
                return
        if spans:
            self.values[name] = round(dimension.value, self.decimals)
            self.notes[name] = self._extent(dimension)
            self.formulas, self.places = formulas, self.places | places

    def _spans(self, dimension: Dimension, *, centers: bool) -> list[tuple[Key, Key]]:
        """The coordinates, the lesser first, whose difference a dimension is (for a radius: twice that)."""
        refs = [ref for ref in dimension.refs if ref[0] in self.names]
        found: list[tuple[Key, Key] | None] = []
        match dimension.kind:
            case "width" | "height" if dimension.round and not centers:
                ends = ("left", "right") if dimension.kind == "width" else ("bottom", "top")
                keys = [next((key for key, at in self.places.items() if at == Linear.of(end)), None) for end in ends]
                found = [(keys[0], keys[1]) if keys[0] and keys[1] else None]
            case "length" if dimension.round and not centers:
                found = [self._along(*ref) for ref in refs if self.has_edges(ref[0])]
            case "radius" if not centers:
                found = [self._across(*ref) for ref in refs if self.has_edges(ref[0])]
            case "distance" if dimension.round and len(refs) == 2:
                found = [self._between(*refs, centers=centers)]
        spans = [span if self.at(span[0]) < self.at(span[1]) else span[::-1] for span in found if span is not None]
        return spans if len(spans) == len(found) else []

    def _extent(self, dimension: Dimension) -> str:
        """Of what a length or distance is, in words; "" if its name tells."""
        refs = [ref for ref in dimension.refs if ref[0] in self.names]
        lines = [str(self.places[axis, *ref]) for ref in refs for axis in (0, 1) if (axis, *ref) in self.level]
        match dimension.kind:
            case "length":
                return f"of the side{'s' if len(lines) > 1 else ''} at {listed(lines)}"
            case "distance" if lines:
                return f"from {' to '.join(lines)}"
            case "distance":
                return f"of {contours([self.names[loop] for loop, _ in refs])}"
        return ""

    def _along(self, loop: int, k: int) -> tuple[Key, Key] | None:
        """The ends of a level or upright line, along it."""
        axis = next((axis for axis in (0, 1) if (1 - axis, loop, k) in self.level), None)
        return None if axis is None else ((axis, loop, k), (axis, loop, self.after(loop, k)))

    def _across(self, loop: int, k: int) -> tuple[Key, Key] | None:
        """The ends of a semicircle between two named lines, across them."""
        ends = [((axis, loop, k), (axis, loop, self.after(loop, k))) for axis in (0, 1)]
        for other, span in (ends, ends[::-1]):
            if abs(abs(self.loops[loop].bulges[k]) - 1) <= BULGE and self._equal(*other):
                return span if all(key in self.places for key in (*span, *other)) else None
        return None

    def _between(self, a: tuple[int, int], b: tuple[int, int], *, centers: bool) -> tuple[Key, Key] | None:
        """Two parallel lines, or two centres that are level with each other, along their distance."""
        for axis in (0, 1):
            if centers and a[0] in self.circles and b[0] in self.circles:
                keys, others = ([(each, ref[0], CENTER) for ref in (a, b)] for each in (axis, 1 - axis))
                if self.expression(others[0]) == self.expression(others[1]):
                    return keys[0], keys[1]
            elif not centers and (axis, *a) in self.level and (axis, *b) in self.level:
                return (axis, *a), (axis, *b)
        return None

    def _solved(self, zero: Linear, formulas: dict[str, Linear]) -> bool:
        """Whether ``zero`` could be made 0 by a formula for one of its coordinates, which ``formulas`` then has."""
        rest = zero.substituted(formulas)
        names = [name for name, factor in rest.terms if name in self.coordinates and abs(abs(factor) - 1) < 1e-9]
        if not names:
            return False
        chosen = max(names, key=lambda name: (-FIXED.get(name, 0), self.values[name], name))
        factor = rest.factor(chosen)
        formula = (Linear.of(chosen, factor) - rest).times(1 / factor)
        formula = Linear(
            formula.constant, tuple(sorted(formula.terms, key=lambda term: term[0] not in self.coordinates))
        )
        for name, known in formulas.items():
            formulas[name] = known.substituted({chosen: formula})
        formulas[chosen] = formula
        return all(len(each.text(self.decimals)) <= LONGEST for each in formulas.values())

    def join_centers(self) -> None:
        """Names the coordinates that the centres of several circles have, or computes them from an arc's centre."""
        groups, arcs = _Groups(), dict[Key, Linear]()
        for relation in self.sketch.relations:
            for axis in CENTERED.get(relation.kind, ()):
                keys = [(axis, loop, CENTER) for loop, _ in relation.refs if loop in self.circles]
                known = [at for ref in relation.refs if (at := self._center(axis, *ref)) is not None]
                if len(relation.refs) > 1 and keys:
                    for key in keys:
                        groups.join(keys[0], key)
                        arcs |= {key: known[0]} if known else {}
        for axis in (0, 1):
            named: dict[str, list[list[Key]]] = {}
            for members in sorted(groups.of(axis), key=lambda group: self.at(group[0])):
                if not all(self._equal(members[0], key) for key in members):
                    continue
                arc = next((arcs[key] for key in members if key in arcs), None)
                if arc is not None and abs(arc.value(self.values) - self.at(members[0])) <= self.slack:
                    self.places |= dict.fromkeys(members, arc)
                elif len(members) > 1:
                    named.setdefault(self._role(members), []).append(members)
            for role, lists in named.items():
                for k, members in enumerate(lists, 1):
                    name = f"{role}_{'xy'[axis]}" + (f"_{k}" if len(lists) > 1 else "")
                    self._name(name, members, self._members(members))
        for loop in self.circles:
            keys = [(axis, loop, CENTER) for axis in (0, 1)]
            for axis, key in enumerate(keys):
                if key not in self.places and keys[1 - axis] in self.places:
                    self._name(f"{self.names[loop]}_{'xy'[axis]}", [key])

    def _center(self, axis: int, loop: int, k: int) -> Linear | None:
        """A coordinate of the centre of an arc that depends on parameters."""
        if not self.has_edges(loop) or self.loops[loop].bulges[k] == 0:
            return None
        at = center(self.vertex(loop, k), self.vertex(loop, self.after(loop, k)), self.loops[loop].bulges[k])[axis]
        return at if at.terms else None

    def _role(self, members: Sequence[Key]) -> str:
        roles = {self.names[loop].partition("_")[0] for _, loop, _ in members}
        return roles.pop() if len(roles) == 1 else "center"

    def _members(self, members: Sequence[Key]) -> str:
        return f"of {contours([self.names[loop] for _, loop, _ in members])}"

    def result(self) -> Shared:
        """All that was found; nothing if a point were not where it is."""
        free = {name: value for name, value in self.values.items() if name not in self.formulas}
        values = free | {name: formula.value(free) for name, formula in self.formulas.items()}
        if any(abs(at.value(values) - self.at(key)) > self.slack for key, at in self.places.items()):
            return Shared()
        points: dict[Point, Place] = {}
        centers: dict[int, Place] = {}
        for _, loop, vertex in self.places:
            place = self.expression((0, loop, vertex)), self.expression((1, loop, vertex))
            if vertex == CENTER:
                centers[loop] = place
            else:
                points[self.loops[loop].points[vertex]] = place
        order = sorted(values, key=lambda name: SIDES.index(name) if name in SIDES else len(SIDES))
        return Shared(
            tuple(Parameter(name, free[name], self.notes.get(name, "")) for name in order if name in free),
            tuple(
                Parameter(name, self.formulas[name].text(self.decimals), self.notes.get(name, ""))
                for name in order
                if name in self.formulas
            ),
            points,
            self.radii,
            centers,
        )


@dataclass(frozen=True, slots=True)
class _Setback:
    """The coordinate ``free`` of an end of a fillet or chamfer is ``way`` from the ``corner``'s, another vertex's."""

    free: Key
    corner: Key
    way: float

    @property
    def size(self) -> float:
        return abs(self.way)


class _Groups:
    """Coordinates that are equal, as a disjoint-set forest."""

    def __init__(self) -> None:
        self.home: dict[Key, Key] = {}

    def root(self, key: Key) -> Key:
        while self.home.setdefault(key, key) != key:
            key = self.home[key]
        return key

    def join(self, a: Key, b: Key) -> None:
        self.home[self.root(b)] = self.root(a)

    def of(self, axis: int) -> list[list[Key]]:
        """Those along an axis, in the order in which they came."""
        found: dict[Key, list[Key]] = {}
        for key in self.home:
            if key[0] == axis:
                found.setdefault(self.root(key), []).append(key)
        return list(found.values())
