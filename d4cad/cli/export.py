"""`d4cad export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from d4cad.cli import forms
from d4cad.cli.options import (
    Branches,
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
    ScriptGrammar,
    Separate,
    Style,
    Thickness,
    Tolerance,
    Width,
)
from d4cad.cli.running import check_outputs, report, reported, write
from d4cad.errors import D4cadError


def export(
    program: Annotated[
        Path,
        typer.Argument(
            metavar="PROGRAM",
            help="A program file, or a .dxf or .svg drawing.",
            show_default=False,
        ),
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
    pocket: forms.PocketOption = None,
    emboss: forms.EmbossOption = None,
    engrave: forms.EngraveOption = None,
    base: forms.Base = None,
    margin: forms.Margin = None,
    draft: forms.Draft = None,
    fillet: forms.FilletOption = None,
    chamfer: forms.ChamferOption = None,
    rim: forms.Rim = None,
    revolve: forms.RevolveOption = False,
    angle: forms.Angle = None,
    axis: forms.Axis = None,
    shell: forms.ShellOption = None,
    open_side: forms.Open = None,
    list_loops: forms.ListLoops = False,
    grammar: ScriptGrammar = None,
    branches: Branches = None,
    separate: Separate = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Write CAD files from a program file or drawing. Size, origin and thickness are the file's unless given.

    Options that a format cannot hold, such as the kerf of a solid or the fillet of a drawing, go to the other outputs.
    """
    with reported():
        from d4cad.exporters import Options
        from d4cad.exporters.kerf import losses
        from d4cad.placement import Placement

        Placement(width, scale, dpi, "corner" if origin is None else origin, thickness)
        form = forms.form_of(
            pocket=pocket,
            emboss=emboss,
            engrave=engrave,
            base=base,
            margin=margin,
            draft=draft,
            fillet=fillet,
            chamfer=chamfer,
            rim=rim,
            revolve=revolve,
            angle=angle,
            axis=axis,
            shell=shell,
            open_side=open_side,
        )
        outputs = output or []
        if list_loops and outputs:
            raise D4cadError("--list-loops writes nothing: leave it or -o out")
        if not (outputs or list_loops):
            raise D4cadError("there is nothing to write: name a file with -o")
        options = Options(name, schema, color, tolerance, kerf, style, dialect, form)
        check_outputs(outputs, None, None, options)
        from d4cad import pieces
        from d4cad.programs import load_program

        found = load_program(program, grammar)
        if "drawing" in found.settings and not (scale is None and dpi is None):
            raise D4cadError(f"{program} is a drawing, which has no pixels: give --width in place of --scale or --dpi")
        placement = found.placement(width, scale, dpi, origin, thickness)
        pieces.require(found.language, branches, separate=separate, outputs=outputs, options=options)
        found = pieces.drawn(found, placement, branches, separate=separate)
        if list_loops:
            typer.echo(forms.loops_text(placement.place(found.outline, found.canvas), as_json=as_json))
            return
        notes = () if kerf is None else losses(placement.place(found.outline, found.canvas), kerf)
        write(found, placement, outputs, None, options)
        report(found, placement, outputs, None, quiet=quiet, as_json=as_json, notes=notes, form=form)
