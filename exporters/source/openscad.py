"""OpenSCAD source: polygons with facets as fine as a parameter says, since OpenSCAD knows no arcs."""

from __future__ import annotations

from d4cad import __version__
from d4cad.exporters.source.parameters import Names, Parameter
from d4cad.exporters.source.plan import Contour, Face, Plan
from d4cad.exporters.source.words import number, plain
from d4cad.features import Circle, Feature, Rectangle, RegularPolygon, RoundedRectangle, Slot
from d4cad.loop import Point

EXACT = 17
"""Decimals of a parameter that was rounded already, or that the user gave."""

FACETS = """\
// Facets of a full circle: a multiple of four, each within chord_tolerance of it.
function facets(radius) =
    4 * ceil(45 / acos(1 - min(chord_tolerance / scale / radius, 0.29)));
"""

ARC = """\
// Points of the arc from p0 to p1, without p1. bulge = tan(sweep / 4), > 0
// counter-clockwise.
function arc(p0, p1, bulge) =
    let (
        chord = p1 - p0,
        lift = (1 - bulge * bulge) / (4 * bulge),
        center = (p0 + p1) / 2 + lift * [-chord.y, chord.x],
        start = p0 - center,
        sweep = 4 * atan(bulge),
        n = ceil(facets(norm(start)) * abs(sweep) / 360)
    )
    [for (i = [0:n - 1]) let (a = sweep * i / n)
        center + [start.x * cos(a) - start.y * sin(a), start.x * sin(a) + start.y * cos(a)]];
"""


def source(plan: Plan, name: str, tolerance: float) -> str:
    """The part as an OpenSCAD script. ``tolerance``: mm, of its facets, the value of its parameter."""
    origin = plain(name)
    lines = [
        f"// Made by d4cad {__version__}{f' from {origin}' if origin else ''}: {plan.edges}.",
        "// Open it in OpenSCAD, or run: openscad -o part.stl FILE",
        "",
        *(_assignment(parameter, plan) for parameter in plan.parameters),
        f"chord_tolerance = {number(tolerance, EXACT)}; // mm from the facets to the exact circle",
        "",
        *(_assignment(parameter, plan) for parameter in plan.dimensions),
        *([""] if plan.dimensions else []),
        *(_assignment(parameter, plan) for parameter in plan.formulas),
        *([""] if plan.formulas else []),
        *(f"// {each}" for each in plan.relations),
        *([""] if plan.relations else []),
        "linear_extrude(thickness) scale(scale) {",
        *(line for face in plan.faces for line in _face(face)),
        "}",
        "",
    ]
    for contour in plan.contours:
        comments = [f"// {comment}" for comment in contour.comments]
        lines += [*comments, f"module {contour.name}() {{", *_body(contour, plan), "}", ""]
    arcs = any(piece.middle is not None for contour in plan.contours for piece in contour.pieces)
    rounds = any(isinstance(contour.feature, (Circle, RoundedRectangle, Slot)) for contour in plan.contours)
    return "\n".join([*lines, *([FACETS] if arcs or rounds else []), *([ARC] if arcs else [])])


def _face(face: Face) -> list[str]:
    if not face.holes:
        return [f"    {face.outer.name}();"]
    return ["    difference() {", *(f"        {contour.name}();" for contour in face.contours), "    }"]


def _assignment(parameter: Parameter, plan: Plan) -> str:
    value = parameter.value
    match value:
        case str():
            text = value
        case (x, y):
            text = f"[{plan.number(x)}, {plan.number(y)}]"
        case _:
            text = number(value, EXACT)
    return f"{parameter.name} = {text};" + (f" // {parameter.note}" if parameter.note else "")


def _body(contour: Contour, plan: Plan) -> list[str]:
    if contour.feature is not None:
        turn = f" rotate({contour.names['angle']})" if "angle" in contour.names else ""
        return [f"    translate({_center(contour.names)}){turn}", *_primitive(contour.feature, contour.names)]
    pieces = contour.pieces
    if len(pieces) == 1:
        points = ",\n".join(f"        {_point(point, plan)}" for point in pieces[0].points[:-1])
        return ["    polygon([", points, "    ]);"]
    parts = []
    for piece in pieces:
        points = ", ".join(_point(point, plan) for point in piece.points[:-1])
        if piece.middle is None:
            parts.append(f"        [{points}]")
        else:
            parts.append(f"        arc({points}, {_point(piece.points[-1], plan)}, {_bulge(piece.bulge)})")
    return ["    polygon(concat(", ",\n".join(parts), "    ));"]


def _primitive(found: Feature, names: dict[str, str]) -> list[str]:
    match found:
        case Circle():
            return [f"        circle(d = {names['diameter']}, $fn = facets({names['diameter']} / 2));"]
        case Rectangle():
            return [f"        square([{names['width']}, {names['height']}], center = true);"]
        case RoundedRectangle():
            width, height, radius = names["width"], names["height"], names["radius"]
            return [
                f"        offset(r = {radius}, $fn = facets({radius}))",
                f"            square([{width} - 2 * {radius}, {height} - 2 * {radius}], center = true);",
            ]
        case Slot():
            length, width = names["length"], names["width"]
            return [
                "        hull() for (side = [-1, 1])",
                f"            translate([side * ({length} - {width}) / 2, 0])",
                f"                circle(d = {width}, $fn = facets({width} / 2));",
            ]
        case RegularPolygon(sides=sides):
            return [f"        circle(r = {names['radius']}, $fn = {sides});"]


def _bulge(value: float) -> str:
    return f"{value:.12g}"


def _center(names: Names) -> str:
    return names["center"] if "center" in names else f"[{names['x']}, {names['y']}]"


def _point(point: Point, plan: Plan) -> str:
    x, y = plan.place(point)
    return f"[{x.text(plan.decimals)}, {y.text(plan.decimals)}]"
