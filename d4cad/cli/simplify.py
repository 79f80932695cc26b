"""`d4cad simplify`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from d4cad.cli.options import Json, Output, Quiet, Thickness
from d4cad.cli.running import check_outputs, reported
from d4cad.errors import D4cadError


def simplify(
    drawing: Annotated[
        Path, typer.Argument(metavar="DRAWING", help="A .dxf or .svg drawing or a .json program.", show_default=False)
    ],
    tolerance: Annotated[
        str,
        typer.Option("--tolerance", "-t", metavar="LENGTH", help="Such as 0.05mm, 0.002in, 2px; mm without a unit."),
    ] = "0.05mm",
    output: Output = None,
    layer: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Layer of a DXF drawing; repeatable.", show_default="all visible"),
    ] = None,
    gap: Annotated[float, typer.Option(metavar="MM", help="Ends of strokes so near are joined.")] = 0.01,
    preview: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Before and after as .png or .svg.", show_default=False)
    ] = None,
    thickness: Thickness = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Draw the outlines of a drawing with as few lines and arcs as a tolerance allows."""
    with reported():
        from d4cad.placement import Placement

        Placement(thickness=thickness)
        outputs = output or []
        check_outputs(outputs, preview, None)
        for path in [*outputs, *([] if preview is None else [preview])]:
            if path.resolve() == drawing.resolve():
                raise D4cadError(f"cannot write {path}: it is the drawing")
        from d4cad.reduction import reduced, text

        found = reduced(drawing, tolerance, gap=gap, layers=layer or [])
        facts = found.facts([*outputs, *([] if preview is None else [preview])])
        fit = found.fit
        for path in outputs:
            fit.write(path, fit.placement(thickness=thickness))
        if preview is not None:
            from d4cad.exporters.overlay import write_overlay

            title = f"{drawing.name}: {facts['primitives_before']} to {facts['primitives']} primitives"
            write_overlay(preview, found.before, found.after, title)
        if as_json:
            typer.echo(json.dumps(facts, allow_nan=False))
        elif not quiet:
            typer.echo(text(facts))
