"""Options of `d4cad export` that say how the outline becomes a solid, and the list of loops that pockets name."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from math import radians
from typing import TYPE_CHECKING, Annotated, Any

import typer

from d4cad.errors import InputError

if TYPE_CHECKING:
    from d4cad.exporters.form import Form, Pocket
    from d4cad.sketch import Sketch

PocketOption = Annotated[
    list[str] | None,
    typer.Option(
        "--pocket",
        metavar="LOOP=MM",
        help="Depth from the top of a hole that is blind; LOOP as --list-loops has it, or all; repeatable.",
        show_default=False,
    ),
]
EmbossOption = Annotated[
    float | None, typer.Option("--emboss", metavar="MM", help="Raise the shape on a base plate.", show_default=False)
]
EngraveOption = Annotated[
    float | None, typer.Option("--engrave", metavar="MM", help="Cut the shape into a base plate.", show_default=False)
]
Base = Annotated[
    float | None, typer.Option(metavar="MM", help="Thickness of the base plate.", show_default="the thickness")
]
Margin = Annotated[float | None, typer.Option(metavar="MM", help="Base plate around the shape.", show_default="5")]
Draft = Annotated[
    float | None,
    typer.Option(metavar="DEG", help="Lean of the walls; positive narrows upwards, holes widen.", show_default=False),
]
FilletOption = Annotated[
    float | None, typer.Option("--fillet", metavar="MM", help="Round the rim by this radius.", show_default=False)
]
ChamferOption = Annotated[
    float | None, typer.Option("--chamfer", metavar="MM", help="Bevel the rim by this much.", show_default=False)
]
Rim = Annotated[str | None, typer.Option(metavar="WHERE", help="Rim to work: top, bottom or both.", show_default="top")]
RevolveOption = Annotated[
    bool, typer.Option("--revolve", help="Turn the shape, a half profile, about its y axis, which becomes z.")
]
Angle = Annotated[float | None, typer.Option(metavar="DEG", help="Angle of the revolution.", show_default="360")]
Axis = Annotated[
    str | None,
    typer.Option(metavar="WHERE", help="Axis of the revolution: origin (x = 0) or left edge.", show_default="origin"),
]
ShellOption = Annotated[
    float | None, typer.Option("--shell", metavar="MM", help="Hollow the part, leaving this wall.", show_default=False)
]
Open = Annotated[
    str | None, typer.Option("--open", metavar="WHERE", help="Open side of a shell: top or bottom.", show_default="top")
]
ListLoops = Annotated[bool, typer.Option("--list-loops", help="Print the loops with their numbers, and write nothing.")]


def form_of(
    *,
    pocket: Sequence[str] | None = None,
    emboss: float | None = None,
    engrave: float | None = None,
    base: float | None = None,
    margin: float | None = None,
    draft: float | None = None,
    fillet: float | None = None,
    chamfer: float | None = None,
    rim: str | None = None,
    revolve: bool = False,
    angle: float | None = None,
    axis: str | None = None,
    shell: float | None = None,
    open_side: str | None = None,
) -> Form:
    """The form that the options ask for, None where one was not given. Raises InputError."""
    from d4cad.exporters.form import Chamfer, Emboss, Engrave, Fillet, Form, Revolve, Shell

    _exclude("--emboss", emboss, "--engrave", engrave)
    _exclude("--fillet", fillet, "--chamfer", chamfer)
    plate = {"--base": base, "--margin": margin}
    _need(plate, "--emboss or --engrave", emboss is not None or engrave is not None)
    _need({"--rim": rim}, "--fillet or --chamfer", fillet is not None or chamfer is not None)
    _need({"--angle": angle, "--axis": axis}, "--revolve", revolve)
    _need({"--open": open_side}, "--shell", shell is not None)
    around = 5.0 if margin is None else margin
    edges = "top" if rim is None else rim
    relief = None if emboss is None else Emboss(emboss, base, around)
    worked = None if fillet is None else Fillet(fillet, edges)
    return Form(
        pockets=[_pocket(text) for text in pocket or ()],
        draft=radians(draft or 0.0),
        rim=worked if chamfer is None else Chamfer(chamfer, edges),
        shell=None if shell is None else Shell(shell, "top" if open_side is None else open_side),
        relief=relief if engrave is None else Engrave(engrave, base, around),
        revolve=Revolve(radians(360.0 if angle is None else angle), axis or "origin") if revolve else None,
    )


def _pocket(text: str) -> Pocket:
    from d4cad.exporters.form import Pocket

    loop, _, depth = text.partition("=")
    try:
        return Pocket(float(depth), None if loop == "all" else int(loop))
    except InputError:
        raise
    except ValueError:
        raise InputError(f"a pocket is LOOP=MM, as in 2=1.5 or all=1.5, got {text!r}") from None


def _exclude(first: str, a: float | None, second: str, b: float | None) -> None:
    if a is not None and b is not None:
        raise InputError(f"expected one of {first} and {second}, got both")


def _need(options: Mapping[str, object], owner: str, given: bool) -> None:
    for name, value in options.items():
        if value is not None and not given:
            raise InputError(f"{name} needs {owner}")


def listing(sketch: Sketch) -> list[dict[str, Any]]:
    """What can be said of every loop of a sketch in mm, in the order of `Sketch.loops`."""
    found: list[dict[str, Any]] = []
    for face in sketch.faces:
        for loop in face.loops:
            xmin, ymin, xmax, ymax = loop.bounds
            circle = loop.circle
            found.append(
                {
                    "loop": len(found),
                    "kind": "outer" if loop is face.outer else "hole",
                    "shape": "outline" if circle is None else "circle",
                    "size_mm": [xmax - xmin, ymax - ymin],
                    "center_mm": [(xmin + xmax) / 2, (ymin + ymax) / 2],
                    "area_mm2": abs(loop.area),
                }
            )
    return found


def loops_text(sketch: Sketch, *, as_json: bool) -> str:
    """The list of loops as a table, or as one JSON object."""
    rows = listing(sketch)
    if as_json:
        return json.dumps({"loops": rows}, allow_nan=False)
    lines = ["loop  kind   size (mm)         centre (mm)       area (mm^2)"]
    for row in rows:
        (width, height), (x, y) = row["size_mm"], row["center_mm"]
        size = f"diameter {width:.4g}" if row["shape"] == "circle" else f"{width:.4g} x {height:.4g}"
        centre = f"{_settled(x):.4g}, {_settled(y):.4g}"
        lines.append(f"{row['loop']:>4}  {row['kind']:<5}  {size:<16}  {centre:<16}  {row['area_mm2']:.5g}")
    return "\n".join(lines)


def _settled(value: float) -> float:
    """Without the rounding that would print as -1e-16."""
    return round(value, 6) + 0.0
