"""build123d source, in builder mode and in algebra mode."""

from __future__ import annotations

import re
from collections.abc import Sequence

from d4cad.exporters.source.layout import (
    COLUMNS,
    INDENT,
    Group,
    Node,
    array,
    assignments,
    call,
    center,
    functions,
    laid,
    middle,
    opening,
    point,
    scaled,
)
from d4cad.exporters.source.parameters import Names
from d4cad.exporters.source.plan import Contour, Family, Piece, Plan
from d4cad.features import Circle, Feature, Rectangle, RegularPolygon, RoundedRectangle, Slot

NAMES = (
    *("BuildLine", "BuildPart", "BuildSketch", "Circle", "Line", "Locations", "Mode", "Polyline", "Pos", "RadiusArc"),
    *("Rectangle", "RectangleRounded", "RegularPolygon", "Sketch", "SlotOverall", "ThreePointArc"),
    *("extrude", "make_face"),
)
"""What the source may import, in the order in which linters want it."""

HOW = (
    "Needs build123d. Import `result` from this file, or show it in OCP CAD Viewer:",
    "`from ocp_vscode import show; show(result)`.",
)


def builder(plan: Plan, name: str) -> str:
    """The part in builder mode: nested contexts, a BuildLine for each contour of edges."""
    lines = ["with BuildPart() as part:", f"{INDENT}with BuildSketch() as profile:"]
    for face in plan.faces:
        for family in face.families:
            lines += _built(family, plan)
    lines += [f"{INDENT}extrude(amount=thickness)", "", "result = part.part"]
    return _module(plan, name, lines)


def algebra(plan: Plan, name: str) -> str:
    """The part in algebra mode: one sketch for each contour, faces by subtraction."""
    lines: list[str] = []
    for contour in plan.contours:
        lines += [*(f"# {comment}" for comment in contour.comments), *_made(contour, plan), ""]
    named = []
    for k, face in enumerate(plan.faces, 1):
        if face.holes:
            named.append(f"face_{k}" if len(plan.faces) > 1 else "profile")
            holes = [hole.name for hole in face.holes]
            lines += laid(array(holes) if len(holes) > 1 else holes[0], before=f"{named[-1]} = {face.outer.name} - ")
        else:
            named.append(face.outer.name)
    if len(named) > 1:
        lines += laid(array(named), before="profile = Sketch() + ")
    lines += [f"result = extrude({'profile' if len(named) > 1 else named[0]}, amount=thickness)"]
    return _module(plan, name, lines)


def _module(plan: Plan, name: str, body: Sequence[str]) -> str:
    text = "\n".join(body)
    used = [known for known in NAMES if re.search(rf"\b{known}\b(?!:)", re.sub(r"#.*", "", text))]
    imports = laid(Group("", tuple(used), ""), before="from build123d import ")
    if len(imports) > 1:
        imports = ["from build123d import (", *(f"{INDENT}{each}," for each in used), ")"]
    return "\n".join([*opening(plan, name, HOW), *imports, "", *assignments(plan), *functions(plan), *body, ""])


# Builder mode


def _built(family: Family, plan: Plan) -> list[str]:
    first, mode = family.first, ["mode=Mode.SUBTRACT"] if family.subtracted else []
    comments = [f"{INDENT * 2}# {comment}" for comment in family.comments]
    if first.feature is None:
        edges = [line for edge in _edges(first.pieces, plan, all_named=False) for line in laid(edge[1], 3, edge[0])]
        return [*comments, f"{INDENT * 2}with BuildLine() as {first.name}:", *edges, *laid(call("make_face", *mode), 2)]
    places = laid(call("Locations", *(center(member.names) for member in family.members)), 2, "with ", ":")
    angle = [f"rotation={first.names['angle']}"] if "angle" in first.names else []
    return [*comments, *places, *laid(_primitive(first.feature, first.names, [*angle, *mode]), 3)]


def _primitive(found: Feature, names: Names, options: Sequence[Node]) -> Group:
    match found:
        case Circle():
            return call("Circle", f"{scaled(names['diameter'])} / 2", *options)
        case Rectangle():
            return call("Rectangle", scaled(names["width"]), scaled(names["height"]), *options)
        case RoundedRectangle():
            sizes = [scaled(names[key]) for key in ("width", "height", "radius")]
            return call("RectangleRounded", *sizes, *options)
        case Slot():
            return call("SlotOverall", scaled(names["length"]), scaled(names["width"]), *options)
        case RegularPolygon(sides=sides):
            return call("RegularPolygon", scaled(names["radius"]), str(sides), *options)


# Algebra mode


def _made(contour: Contour, plan: Plan) -> list[str]:
    if contour.feature is None:
        edges = _edges(contour.pieces, plan, all_named=True)
        lines = [line for before, edge in edges for line in laid(edge, before=before)]
        named = [before.removesuffix(" = ") for before, _ in edges]
        face = call("make_face", array(named) if len(named) > 1 else named[0])
        return [*lines, *laid(face, before=f"{contour.name} = ")]
    angle = [f"rotation={contour.names['angle']}"] if "angle" in contour.names else []
    shape = _primitive(contour.feature, contour.names, angle)
    place = call("Pos", center(contour.names))
    if len(f"{contour.name} = {place} * {shape.head}") <= COLUMNS:
        return laid(shape, before=f"{contour.name} = {place} * ")
    return laid(place, before=f"{contour.name} = ", after=f" * {shape}")


# Edges of both modes


def _edges(pieces: Sequence[Piece], plan: Plan, *, all_named: bool) -> list[tuple[str, Group]]:
    """For each piece its assignment, "" where nothing refers to it, and its call; each vertex is written once."""
    if len(pieces) == 1:
        ring = call("Polyline", *(point(place, plan) for place in pieces[0].points[:-1]), "close=True")
        return [("line_1 = " if all_named else "", ring)]
    names = [f"{'line' if piece.middle is None else 'arc'}_{k}" for k, piece in enumerate(pieces, 1)]
    made = []
    for k, piece in enumerate(pieces):
        last = k == len(pieces) - 1
        start = f"{names[k - 1]} @ 1" if k else point(piece.points[0], plan)
        end = f"{names[0]} @ 0" if last else point(piece.points[-1], plan)
        before = "" if last and not all_named else f"{names[k]} = "
        made.append((before, _edge(piece, start, end, plan)))
    return made


def _edge(piece: Piece, start: Node, end: Node, plan: Plan) -> Group:
    if piece.middle is None:
        between = [point(place, plan) for place in piece.points[1:-1]]
        return call("Polyline" if between else "Line", start, *between, end)
    if piece.radius is not None:  # build123d's sign: > 0 is clockwise
        return call("RadiusArc", start, end, scaled(plan.radius(piece, sign=-1)))
    return call("ThreePointArc", start, middle(piece, plan), end)
