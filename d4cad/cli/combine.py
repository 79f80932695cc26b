"""`d4cad combine`."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from d4cad.cli.options import Json, Quiet, Thickness
from d4cad.cli.running import check_outputs, reported, write
from d4cad.errors import D4cadError


class Operation(StrEnum):
    """What is kept: in either, in the first only, in both."""

    UNION = "union"
    DIFFERENCE = "difference"
    INTERSECTION = "intersection"


def combine(
    first: Annotated[
        Path, typer.Argument(metavar="A", help="Program file or drawing of one part.", show_default=False)
    ],
    operation: Annotated[Operation, typer.Argument(help="What is kept.", show_default=False)],
    second: Annotated[
        Path, typer.Argument(metavar="B", help="Program file or drawing of the other.", show_default=False)
    ],
    output: Annotated[
        list[Path] | None,
        typer.Option("--output", "-o", metavar="FILE", help="File to write, as `export` does; repeatable."),
    ] = None,
    at: Annotated[str, typer.Option(metavar="X,Y", help="Move B by this many mm first.")] = "0,0",
    thickness: Thickness = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Combine two parts exactly, their lines and arcs kept, and write CAD files.

    Both parts have the size and place that their files state.
    """
    with reported():
        from d4cad import booleans
        from d4cad.cli.parts import pair, read_part, read_thickness
        from d4cad.importers import Drawing
        from d4cad.placement import DEFAULT_THICKNESS, Placement

        Placement(thickness=thickness)
        outputs = output or []
        if not outputs:
            raise D4cadError("there is nothing to write: name a file with -o")
        check_outputs(outputs, None, None)
        a, b = read_part(first), read_part(second).translated(*pair(at, ",", "--at"))
        found = getattr(booleans, operation.value)(a, b)
        if not found.faces:
            raise D4cadError(f"nothing is left of {first} {operation.value} {second}")
        height = thickness or read_thickness(first) or DEFAULT_THICKNESS
        from d4cad.programs import from_drawing

        fit = from_drawing(Drawing(found, found.primitives), f"{first.name} {operation.value} {second.name}")
        write(fit, fit.placement(thickness=height), outputs, None)
        facts = {
            "operation": operation.value,
            "faces": len(found.faces),
            "holes": sum(len(face.holes) for face in found.faces),
            "primitives": found.primitives,
            "area_mm2": found.area,
            "bounds_mm": list(found.bounds),
            "files": [str(path) for path in outputs],
        }
        if as_json:
            typer.echo(json.dumps(facts, allow_nan=False))
        elif not quiet:
            bodies = "1 body" if len(found.faces) == 1 else f"{len(found.faces)} bodies"
            typer.echo(f"{found.primitives} primitives, {bodies}, {facts['holes']} holes, {found.area:.6g} mm2")
            for path in outputs:
                typer.echo(f"wrote {path}")
