"""Coordinates and radii that regularisation has made equal, as named parameters from which the points are computed.

Only what stays exact is named: the lines along x or y, the fillets and chamfers between two of them, the semicircles,
the centres of circles. Sweeps of arcs stay, so that the middle and the centre of an arc are linear in its ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count

from d4cad.exporters.source.bolts import bolt_circles
from d4cad.exporters.source.corners import round_corners
from d4cad.exporters.source.drawing import CENTER, Drawing, Groups, Key
from d4cad.exporters.source.linear import Linear
from d4cad.exporters.source.parameters import Parameter
from d4cad.exporters.source.places import BULGE, QUARTER, Place, center, exact
from d4cad.exporters.source.sizes import impose
from d4cad.exporters.source.words import contours
from d4cad.loop import Point
from d4cad.sketch import Sketch

SIDES = ("left", "right", "width", "bottom", "top", "height")
CENTERED = {"concentric": (0, 1), "horizontal": (1,), "vertical": (0,)}
"""Along which axes the centres are level in a relation between circular edges."""


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


def shared(sketch: Sketch, names: Mapping[int, str], circles: Mapping[int, Point], decimals: int) -> Shared:
    """What the relations and dimensions of a sketch in mm let its points be computed from; nothing if there are none.

    names: what the loops are called whose points are written, by index: those of edges, and those of ``circles``, of
    which the centres are given. decimals: of the parameters. A relation that does not hold is passed over.
    """
    if not sketch.relations:
        return Shared()
    drawing = Drawing(sketch, names, circles, decimals)
    _align(drawing)
    round_corners(drawing)
    for dimension in sketch.dimensions:
        impose(drawing, dimension, centers=False)
    bolt_circles(drawing)
    _join_centers(drawing)
    for dimension in sketch.dimensions:
        impose(drawing, dimension, centers=True)
    return _result(drawing)


def _align(drawing: Drawing) -> None:
    """Names the lines that run along an axis, and the places of semicircles between two of them."""
    groups = Groups()
    for kind, axis in (("horizontal", 1), ("vertical", 0)):
        for relation in drawing.sketch.relations:
            if relation.kind == kind and len(relation.refs) == 1 and drawing.has_edges(relation.refs[0][0]):
                loop, edge = relation.refs[0]
                if drawing.loops[loop].bulges[edge] == 0:
                    groups.join((axis, loop, edge), (axis, loop, drawing.after(loop, edge)))
                    drawing.level.add((axis, loop, edge))
    for a, b in _semicircles(drawing):
        groups.join(a, b)
    several = sum(map(drawing.has_edges, drawing.names)) > 1
    bounds = drawing.sketch.bounds
    sides = {0: {"left": bounds[0], "right": bounds[2]}, 1: {"bottom": bounds[1], "top": bounds[3]}}
    for axis in (0, 1):
        _merge(drawing, groups, axis, tuple(sides[axis].values()))
        inner = count(1)
        for members in sorted(groups.of(axis), key=lambda group: drawing.at(group[0])):
            value = drawing.at(members[0])
            if all(drawing.equal(members[0], key) for key in members):
                side = next((side for side, x in sides[axis].items() if abs(value - x) <= drawing.slack), None)
                loops = [drawing.names[loop] for loop in sorted({loop for _, loop, _ in members})] if several else []
                note = f"of {contours(loops)}" if loops and side is None else ""
                drawing.name(side or f"{'xy'[axis]}_{next(inner)}", members, note=note)
    drawing.level &= drawing.places.keys()  # what is not level in fact has no name


def _semicircles(drawing: Drawing) -> Iterator[tuple[Key, Key]]:
    """The coordinate that both ends of a semicircle between two parallel sides have."""
    for loop in filter(drawing.has_edges, drawing.names):
        bulges = drawing.loops[loop].bulges
        for k, bulge in enumerate(bulges):
            after = drawing.after(loop, k)
            for axis in (0, 1):
                ends = (axis, loop, k), (axis, loop, after)
                sides = {(1 - axis, loop, (k - 1) % len(bulges)), (1 - axis, loop, after)}
                if abs(abs(bulge) - 1) <= BULGE and sides <= drawing.level and drawing.equal(*ends):
                    yield ends


def _merge(drawing: Drawing, groups: Groups, axis: int, sides: Sequence[float]) -> None:
    """Joins the lines of one contour that are in line, and all that are at the same end of the sketch."""
    firsts = [members[0] for members in groups.of(axis)]
    for i, a in enumerate(firsts):
        for b in firsts[i + 1 :]:
            end = any(abs(drawing.at(a) - side) <= drawing.slack for side in sides)
            if drawing.equal(a, b) and (a[1] == b[1] or end):
                groups.join(a, b)


def _join_centers(drawing: Drawing) -> None:
    """Names the coordinates that the centres of several circles have, or computes them from an arc's centre."""
    groups, arcs = Groups(), dict[Key, Linear]()
    for relation in drawing.sketch.relations:
        for axis in CENTERED.get(relation.kind, ()):
            keys = [(axis, loop, CENTER) for loop, _ in relation.refs if loop in drawing.circles]
            known = [at for ref in relation.refs if (at := _center(drawing, axis, *ref)) is not None]
            if len(relation.refs) > 1 and keys:
                for key in keys:
                    groups.join(keys[0], key)
                    arcs |= {key: known[0]} if known else {}
    for axis in (0, 1):
        named: dict[str, list[list[Key]]] = {}
        for members in sorted(groups.of(axis), key=lambda group: drawing.at(group[0])):
            if not all(drawing.equal(members[0], key) for key in members):
                continue
            given = next((each[key] for each in (drawing.places, arcs) for key in members if key in each), None)
            if given is not None and abs(given.value(drawing.values) - drawing.at(members[0])) <= drawing.slack:
                drawing.places |= {key: given for key in members if key not in drawing.places}
            elif len(members) > 1:
                named.setdefault(_role(drawing, members), []).append(members)
        for role, lists in named.items():
            for k, members in enumerate(lists, 1):
                name = f"{role}_{'xy'[axis]}" + (f"_{k}" if len(lists) > 1 else "")
                drawing.name(name, members, note=f"of {contours([drawing.names[loop] for _, loop, _ in members])}")
    for loop in drawing.circles:
        keys = [(axis, loop, CENTER) for axis in (0, 1)]
        for axis, key in enumerate(keys):
            if key not in drawing.places and keys[1 - axis] in drawing.places:
                drawing.name(f"{drawing.names[loop]}_{'xy'[axis]}", [key])


def _center(drawing: Drawing, axis: int, loop: int, k: int) -> Linear | None:
    """A coordinate of the centre of a fillet or semicircle that depends on parameters."""
    bulge = exact(drawing.loops[loop].bulges[k])
    if not drawing.has_edges(loop) or abs(bulge) not in (QUARTER, 1.0):
        return None
    at = center(drawing.vertex(loop, k), drawing.vertex(loop, drawing.after(loop, k)), bulge)[axis]
    return at if at.terms else None


def _role(drawing: Drawing, members: Sequence[Key]) -> str:
    """ "hole" or "outer" if all are that."""
    roles = {drawing.names[loop].partition("_")[0] for _, loop, _ in members}
    return roles.pop() if len(roles) == 1 else "center"


def _result(drawing: Drawing) -> Shared:
    """All that was found; nothing if a point were not where it is."""
    free = {name: value for name, value in drawing.values.items() if name not in drawing.formulas}
    values = free | {name: formula.value(free) for name, formula in drawing.formulas.items()}
    if any(abs(at.value(values) - drawing.at(key)) > drawing.slack for key, at in drawing.places.items()):
        return Shared()
    points: dict[Point, Place] = {}
    centers: dict[int, Place] = {}
    for _, loop, vertex in drawing.places:
        place = drawing.expression((0, loop, vertex)), drawing.expression((1, loop, vertex))
        if vertex == CENTER:
            centers[loop] = place
        else:
            points[drawing.loops[loop].points[vertex]] = place
    order = sorted(values, key=lambda name: SIDES.index(name) if name in SIDES else len(SIDES))
    return Shared(
        tuple(Parameter(name, free[name], drawing.notes.get(name, "")) for name in order if name in free),
        tuple(
            Parameter(name, drawing.formulas[name].text(drawing.decimals), drawing.notes.get(name, ""))
            for name in order
            if name in drawing.formulas
        ),
        points,
        drawing.radii,
        centers,
    )
