"""`d4cad fit`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from d4cad.cli.options import (
    Dpi,
    Grammar,
    Json,
    Method,
    Origin,
    Output,
    Quiet,
    Scale,
    Seed,
    Thickness,
    Variant,
    Width,
)
from d4cad.cli.running import INTERRUPTED, check_outputs, progress, report, reported, write


def fit(
    image: Annotated[Path, typer.Argument(metavar="IMAGE", help="PNG, JPEG, BMP, TIFF or WebP.", show_default=False)],
    output: Output = None,
    preview: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Target, outline and error as .png or .svg.", show_default=False)
    ] = None,
    width: Width = None,
    scale: Scale = None,
    dpi: Dpi = None,
    thickness: Thickness = None,
    origin: Origin = None,
    grammar: Grammar = "arc-line",
    variant: Variant = None,
    method: Method = "fast",
    init: Annotated[str, typer.Option(metavar="axiom|FILE", help="axiom, or a program file to go on from.")] = "axiom",
    seed: Seed = 0,
    max_time: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds after which the search ends.", show_default=False)
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option(metavar="T", help="Grey level from 0 to 1 that parts shape and ground.", show_default="automatic"),
    ] = None,
    invert: Annotated[bool, typer.Option("--invert", help="Exchange shape and ground.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Fit a part to a picture. Ctrl-C ends the search early: the outputs get the best part so far, exit code 130."""
    with reported():
        from d4cad.placement import Placement

        placement = Placement(width, scale, dpi, "corner" if origin is None else origin, thickness)
        outputs = output or []
        check_outputs(outputs, preview, image)
        from d4cad.fit import fit_image

        with progress(max_time, shown=not (quiet or as_json)) as watch:
            found = fit_image(
                image,
                method=method,
                grammar=grammar,
                variant=variant,
                init=init,
                seed=seed,
                max_time=max_time,
                threshold=threshold,
                invert=invert,
                watch=watch,
            )
        placement = found.placement(width, scale, dpi, origin, thickness)
        write(found, placement, outputs, preview)
        report(found, placement, outputs, preview, quiet=quiet, as_json=as_json)
        if found.stop.name == "INTERRUPTED":
            raise typer.Exit(INTERRUPTED)
