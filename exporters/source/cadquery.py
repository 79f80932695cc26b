"""CadQuery source: a Sketch for each contour of edges, a profile of them all, placed and extruded."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, degrees

from d4cad.exporters.source.layout import (
    COLUMNS,
    INDENT,
    Group,
    Node,
    array,
    assignments,
    call,
    center,
    chained,
    computed,
    functions,
    laid,
    middle,
    opening,
    point,
    scaled,
)
from d4cad.exporters.source.plan import Contour, Family, Piece, Plan
from d4cad.features import Circle, Feature, Rectangle, RegularPolygon, RoundedRectangle, Slot

HOW = ("Needs CadQuery. Open it in CQ-editor, or import `result` from this file.",)


def source(plan: Plan, name: str) -> str:
    """The part as a CadQuery script."""
    lines: list[str] = []
    for contour in plan.contours:
        if _has_own_sketch(contour):
            calls = [call("cq.Sketch"), *_sketched(contour, plan)]
            comments = [f"# {comment}" for comment in contour.comments]
            lines += [*comments, *_noted(chained(f"{contour.name} = ", calls), contour, plan), ""]
    lines += [
        *_profile([family for face in plan.faces for family in face.families]),
        "",
        "result = cq.Workplane().placeSketch(profile).extrude(thickness)",
        "",
        'if "show_object" in globals():',
        f"{INDENT}show_object(result)  # noqa: F821",
        "",
    ]
    head = [*opening(plan, name, HOW), "import cadquery as cq", "", *assignments(plan), *functions(plan)]
    return "\n".join([*head, *lines])


def _has_own_sketch(contour: Contour) -> bool:
    """Whether more than one call makes it: a sketch must be assembled, or its corners rounded, only once."""
    return contour.feature is None or isinstance(contour.feature, RoundedRectangle)


def _profile(families: Sequence[Family]) -> list[str]:
    """The chain that puts all contours together, comments at those that have none yet."""
    if all(_has_own_sketch(family.first) for family in families):
        return chained("profile = ", [call("cq.Sketch"), *(step for family in families for step in _steps(family))])
    lines = ["profile = (", f"{INDENT}cq.Sketch()"]
    for family in families:
        if not _has_own_sketch(family.first):
            lines += [f"{INDENT}# {comment}" for comment in family.comments]
        for step in _steps(family):
            lines += laid(step, 1, ".")
    return [*lines, ")"]


def _sketched(contour: Contour, plan: Plan) -> list[Group]:
    """The calls after cq.Sketch() that make a contour of edges, or a rounded rectangle about the origin."""
    if contour.feature is not None:
        names = contour.names
        rectangle = call("rect", scaled(names["width"]), scaled(names["height"]))
        return [rectangle, call("vertices"), call("fillet", scaled(names["radius"])), call("reset")]
    pieces = contour.pieces
    if len(pieces) == 1:
        return [call("polygon", array([point(place, plan) for place in pieces[0].points[:-1]]))]
    calls: list[Group] = []
    for k, piece in enumerate(pieces):
        start = [] if k else [point(piece.points[0], plan)]
        last = k == len(pieces) - 1
        calls += _edges(piece, start, plan, last=last)
    return [*calls, call("assemble")]


def _edges(piece: Piece, start: Sequence[Node], plan: Plan, *, last: bool) -> list[Group]:
    """Each begins where the one before ended; only the first has a start of its own."""
    points = [point(place, plan) for place in piece.points[1:]]
    if piece.center is not None:  # a quarter, told by its centre, radius, first angle and sweep
        return [call("arc", computed(piece.center, plan), scaled(piece.radius_name), *_angles(piece))]
    if piece.middle is not None:
        return [call("arc", *start, middle(piece, plan), *points)]
    segments = [call("segment", *(start if k == 0 else ()), end) for k, end in enumerate(points)]
    return [*segments[:-1], call("close")] if last else segments


def _angles(piece: Piece) -> tuple[str, str]:
    """Of a quarter of a circle between level and upright lines: where it begins and how far it goes, in degrees."""
    (x0, y0), (x1, y1) = piece.points
    turn = 1 if piece.bulge > 0 else -1
    across, up = (x1 - x0) - turn * (y1 - y0), (y1 - y0) + turn * (x1 - x0)  # from the centre to the start, times -2
    first = round(degrees(atan2(-up, -across)) / 90) * 90 % 360
    return str(first), str(90 * turn)


def _noted(lines: list[str], contour: Contour, plan: Plan) -> list[str]:
    """The radius beside each arc that has a short one: three points do not tell it."""
    arcs = iter([piece for piece in contour.pieces if piece.middle is not None])
    noted = []
    for line in lines:
        arc = next(arcs) if line.startswith(f"{INDENT}.arc(") else None
        told = arc is None or arc.radius is None or arc.radius_name
        note = "" if arc is None or told else f"  # radius {plan.radius(arc, sign=0)}"
        noted.append(line + note if len(line + note) <= COLUMNS and not line.endswith("(") else line)
    return noted


def _steps(family: Family) -> list[Group]:
    """The calls that add contours to the profile or cut them from it."""
    first, mode = family.first, ['mode="s"'] if family.subtracted else []
    if first.feature is None:
        return [call("face", first.name, *mode)]
    places = call("push", array([center(member.names) for member in family.members]))
    return [places, _primitive(first, first.feature, mode), call("reset")]


def _primitive(contour: Contour, found: Feature, mode: Sequence[str]) -> Group:
    names = contour.names
    angle = [names["angle"]] if "angle" in names else []
    match found:
        case Circle():
            return call("circle", f"{scaled(names['diameter'])} / 2", *mode)
        case Rectangle():
            return call("rect", scaled(names["width"]), scaled(names["height"]), *angle, *mode)
        case RoundedRectangle():
            return call("face", contour.name, *angle, *mode)
        case Slot():  # CadQuery's first size is between the centres
            sizes = f"({names['length']} - {names['width']}) * scale", scaled(names["width"])
            return call("slot", *sizes, *angle, *mode)
        case RegularPolygon(sides=sides):  # CadQuery's first corner is at the top
            turn = f"{names['angle']} - 90" if angle else "-90"
            return call("regularPolygon", scaled(names["radius"]), str(sides), turn, *mode)
