"""`d4cad export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from d4cad.cli.options import (
    Color,
    Dialect,
    Dpi,
    Json,
    Kerf,
    Name,
    Origin,
    Output,
    Quiet,
    Scale,
    Schema,
    Style,
    Thickness,
    Tolerance,
    Width,
)
from d4cad.cli.running import check_outputs, report, reported, write
from d4cad.errors import D4cadError


def export(
    program: Annotated[
        Path, typer.Argument(metavar="PROGRAM", help="A program file that `d4cad fit` wrote.", show_default=False)
    ],
    output: Output = None,
    width: Width = None,
    scale: Scale = None,
    dpi: Dpi = None,
    thickness: Thickness = None,
    origin: Origin = None,
    name: Name = None,
    color: Color = None,
    schema: Schema = None,
    tolerance: Tolerance = None,
    kerf: Kerf = None,
    style: Style = None,
    dialect: Dialect = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Write CAD files from a program file. Size, origin and thickness are the file's unless given.

    Each of name, color, schema, tolerance, kerf and style goes to the outputs whose format can hold it.
    """
    with reported():
        from d4cad.exporters import Options
        from d4cad.exporters.kerf import losses
        from d4cad.placement import Placement

        Placement(width, scale, dpi, "corner" if origin is None else origin, thickness)
        outputs = output or []
        if not outputs:
            raise D4cadError("there is nothing to write: name a file with -o")
        options = Options(name, schema, color, tolerance, kerf, style, dialect)
        check_outputs(outputs, None, None, options)
        from d4cad.fit import load_program

        found = load_program(program)
        placement = found.placement(width, scale, dpi, origin, thickness)
        notes = () if kerf is None else losses(placement.place(found.outline, found.canvas), kerf)
        write(found, placement, outputs, None, options)
        report(found, placement, outputs, None, quiet=quiet, as_json=as_json, notes=notes)
