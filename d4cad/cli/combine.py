"""`d4cad combine`."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from d4cad.cli.options import Json, Quiet, Thickness
from d4cad.cli.running import reported
from d4cad.errors import D4cadError


class Operation(StrEnum):
    """What is kept: in either, in the first only, in both."""

    UNION = "union"
    DIFFERENCE = "difference"
    INTERSECTION = "intersection"


def combine(
    first: Annotated[Path, typer.Argument(metavar="A", help="Program file of the first part.", show_default=False)],
    operation: Annotated[Operation, typer.Argument(help="What is kept.", show_default=False)],
    second: Annotated[Path, typer.Argument(metavar="B", help="Program file of the second part.", show_default=False)],
    output: Annotated[
        list[Path] | None,
        typer.Option("--output", "-o", metavar="FILE", help="CAD file to write; repeatable.", show_default=False),
    ] = None,
    at: Annotated[str, typer.Option(metavar="X,Y", help="Move B by this many mm first.")] = "0,0",
    thickness: Thickness = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Combine two parts exactly, their lines and arcs kept, and write CAD files.

    Both parts have the size and place that their files state. A program file cannot be written: it would need a canvas.
    """
    with reported():
        from d4cad import booleans, exporters
        from d4cad.cli.parts import pair, read_part, read_thickness
        from d4cad.placement import DEFAULT_THICKNESS, Placement

        Placement(thickness=thickness)
        outputs = output or []
        if not outputs:
            raise D4cadError("there is nothing to write: name a file with -o")
        for path in outputs:
            if path.suffix.lower() == ".json":
                raise D4cadError(f"cannot write {path}: a combined part has no program, only CAD files are written")
            exporters.check(path, thickness=DEFAULT_THICKNESS)
        a, b = read_part(first), read_part(second).translated(*pair(at, ",", "--at"))
        found = getattr(booleans, operation.value)(a, b)
        if not found.faces:
            raise D4cadError(f"nothing is left of {first} {operation.value} {second}")
        height = thickness or read_thickness(first) or DEFAULT_THICKNESS
        for path in outputs:
            exporters.write(found, path, thickness=height)
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
