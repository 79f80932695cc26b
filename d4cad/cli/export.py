"""`d4cad export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from d4cad.cli.options import Dpi, Json, Origin, Output, Quiet, Scale, Thickness, Width
from d4cad.cli.running import check_outputs, report, reported, write
from d4cad.errors import D4cadError


def export(
    program: Annotated[
        Path,
        typer.Argument(
            metavar="PROGRAM",
            help="A program file that `d4cad fit` wrote, or a .dxf or .svg drawing.",
            show_default=False,
        ),
    ],
    output: Output = None,
    width: Width = None,
    scale: Scale = None,
    dpi: Dpi = None,
    thickness: Thickness = None,
    origin: Origin = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Write CAD files from a program file or drawing. Size, origin and thickness are the file's unless given."""
    with reported():
        from d4cad.placement import Placement

        Placement(width, scale, dpi, "corner" if origin is None else origin, thickness)
        outputs = output or []
        if not outputs:
            raise D4cadError("there is nothing to write: name a file with -o")
        check_outputs(outputs, None, None)
        from d4cad.fit import load_program

        found = load_program(program)
        placement = found.placement(width, scale, dpi, origin, thickness)
        write(found, placement, outputs, None)
        report(found, placement, outputs, None, quiet=quiet, as_json=as_json)
