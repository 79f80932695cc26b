"""Python source laid out as `ruff format` and Black do: 88 columns, four spaces, trailing commas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from d4cad import __version__
from d4cad.exporters.source.parameters import Parameter
from d4cad.exporters.source.places import Place
from d4cad.exporters.source.plan import Piece, Plan
from d4cad.exporters.source.words import plain
from d4cad.loop import Point

COLUMNS = 88
INDENT = "    "


@dataclass(frozen=True, slots=True)
class Group:
    """Brackets with items between commas: ``head`` ends with the opening one, ``tail`` is the closing one."""

    head: str
    items: tuple[Node, ...]
    tail: str = ")"

    def __str__(self) -> str:
        return f"{self.head}{', '.join(map(str, self.items))}{self.tail}"


Node = str | Group


def call(function: str, *arguments: Node) -> Group:
    """``function(argument, ...)``."""
    return Group(f"{function}(", arguments)


def array(items: Sequence[Node]) -> Group:
    """``[item, ...]``."""
    return Group("[", tuple(items), "]")


def laid(node: Node, indent: int = 0, before: str = "", after: str = "") -> list[str]:
    """Lines of ``before node after``: on one; else a call's arguments on one of their own; else one for each item."""
    pad = INDENT * indent
    flat = f"{pad}{before}{node}{after}"
    if isinstance(node, str) or len(flat) <= COLUMNS or not node.items:
        return [flat]
    inner = f"{pad}{INDENT}{', '.join(map(str, node.items))}"
    is_call = node.tail == ")"
    if is_call and len(inner) <= COLUMNS:
        body = [inner]
    elif is_call and len(node.items) == 1:
        body = laid(node.items[0], indent + 1)
    else:
        body = [line for item in node.items for line in laid(item, indent + 1, after=",")]
    return [f"{pad}{before}{node.head}", *body, f"{pad}{node.tail}{after}"]


def chained(before: str, calls: Sequence[Group], indent: int = 0) -> list[str]:
    """A fluent chain: the first call, then ``.call(...)`` each, on one line if it fits."""
    pad = INDENT * indent
    flat = f"{pad}{before}{'.'.join(map(str, calls))}"
    if len(flat) <= COLUMNS:
        return [flat]
    if len(calls) == 2:  # one dot alone does not make a chain
        head = f"{calls[0]}.{calls[1].head}"
        return laid(Group(head, calls[1].items, calls[1].tail), indent, before)
    lines = [line for k, each in enumerate(calls) for line in laid(each, indent + 1, "." if k else "")]
    return [f"{pad}{before}(", *lines, f"{pad})"]


def opening(plan: Plan, name: str, how: Sequence[str]) -> list[str]:
    """The module's docstring: where the part comes from, of what it is made, and ``how`` to go on."""
    origin = plain(name)
    by = f"Made by d4cad {__version__}{f' from {origin}' if origin else ''}: {plan.edges}."
    return [f'"""{by}', "", *how, '"""', ""]


def assignments(plan: Plan) -> list[str]:
    """The parameters, the dimensions, what follows from them, and what holds between contours, a block each."""
    lines = [_assignment(parameter, plan) for parameter in plan.parameters]
    for block in (plan.dimensions, plan.formulas):
        if block:
            lines += ["", *(_assignment(parameter, plan) for parameter in block)]
    return [*lines, "", *(f"# {each}" for each in plan.relations)] if plan.relations else lines


def _assignment(parameter: Parameter, plan: Plan) -> str:
    """Sizes are floats, as the numbers that they are may become anything; points are as short as elsewhere."""
    value = parameter.value
    match value:
        case str():
            text = value
        case (x, y):
            text = f"({plan.number(x)}, {plan.number(y)})"
        case _:
            text = repr(value)
    return f"{parameter.name} = {text}" + (f"  # {parameter.note}" if parameter.note else "")


POINT = f'''

def at(x, y):
{INDENT}"""A point of the drawing, in mm."""
{INDENT}return x * scale, y * scale
'''

MIDDLE = f'''

def middle(start, end, bulge):
{INDENT}"""The middle of an arc, whose bulge is tan(sweep / 4), > 0 counter-clockwise."""
{INDENT}x, y = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
{INDENT}return x + bulge * (end[1] - start[1]) / 2, y - bulge * (end[0] - start[0]) / 2
'''


def functions(plan: Plan) -> list[str]:
    """The function through which every point goes, so that ``scale`` is in one place; and one for arcs if needed."""
    return f"{POINT}{MIDDLE if plan.has_bent_arcs else ''}\n".split("\n")


def scaled(name: str) -> str:
    """A length by its parameter's name."""
    return f"{name} * scale"


def center(contour_names: dict[str, str]) -> Group:
    """The centre of a feature as a point in mm."""
    if "center" in contour_names:
        return call("at", f"*{contour_names['center']}")
    return call("at", contour_names["x"], contour_names["y"])


def point(place: Point, plan: Plan) -> Group:
    """A point of the drawing in mm."""
    return computed(plan.place(place), plan)


def computed(place: Place, plan: Plan) -> Group:
    """A point of the drawing in mm from what it is computed from."""
    return call("at", *(each.text(plan.decimals) for each in place))


def middle(piece: Piece, plan: Plan) -> Group:
    """The middle of an arc."""
    start, end = piece.points
    if piece.bent:
        return call("middle", point(start, plan), point(end, plan), f"{piece.bulge:.12g}")
    return point(piece.middle or start, plan)
