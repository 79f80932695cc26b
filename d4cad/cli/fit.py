"""`d4cad fit`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from d4cad.cli import pictures
from d4cad.cli.options import (
    Branches,
    Dpi,
    Grammar,
    Json,
    Method,
    Origin,
    Output,
    Quiet,
    Scale,
    Seed,
    Separate,
    Snap,
    Thickness,
    Variant,
    Width,
)
from d4cad.cli.running import INTERRUPTED, check_outputs, progress, report, reported, write
from d4cad.errors import D4cadError


def fit(
    images: Annotated[
        list[Path],
        typer.Argument(
            metavar="IMAGE...",
            help="PNG, JPEG, BMP, TIFF, WebP or GIF; several, or a pattern such as 'pics/*.png', with --out-dir.",
            show_default=False,
        ),
    ],
    output: Output = None,
    preview: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Target, outline and error as .png or .svg.", show_default=False)
    ] = None,
    animate: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The course of the search as .gif.", show_default=False)
    ] = None,
    width: Width = None,
    scale: Scale = None,
    dpi: Dpi = None,
    thickness: Thickness = None,
    origin: Origin = None,
    grammar: Grammar = "arc-line",
    variant: Variant = None,
    branches: Branches = None,
    separate: Separate = False,
    method: Method = "fast",
    init: Annotated[
        str | None,
        typer.Option(
            metavar="contour|axiom|FILE",
            help="The picture's traced contour, the grammar's axiom, or a program file to go on from.",
            show_default="contour, or axiom for --method paper",
        ),
    ] = None,
    seed: Seed = 0,
    max_time: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds after which the search ends.", show_default=False)
    ] = None,
    threshold: pictures.Threshold = None,
    invert: Annotated[bool, typer.Option("--invert", help="Exchange shape and ground.")] = False,
    snap: Snap = None,
    smooth: pictures.Smooth = 0.0,
    despeckle: pictures.Despeckle = 0,
    tolerance: pictures.ToleranceOf = None,
    lines_only: pictures.LinesOnly = False,
    arcs_only: pictures.ArcsOnly = False,
    min_radius: pictures.MinRadius = None,
    min_feature: pictures.MinFeature = None,
    layers: pictures.Layers = None,
    report_file: pictures.ReportFile = None,
    out_dir: pictures.OutDir = None,
    jobs: pictures.Jobs = 1,
    force: pictures.Force = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Fit a part to a picture. Ctrl-C ends the search early: the outputs get the best part so far, exit code 130.

    Several pictures go to a folder; one that fails does not stop the others, and makes the exit code 2.
    """
    with reported():
        from d4cad import animation, pieces
        from d4cad.finishing import Finish, fit_finished
        from d4cad.placement import Placement

        placement = Placement(width, scale, dpi, "corner" if origin is None else origin, thickness)
        finish = Finish(tolerance, lines_only, arcs_only, min_radius, min_feature)
        options: dict[str, Any] = {
            "method": method,
            "grammar": grammar,
            "variant": variant,
            "init": init,
            "seed": seed,
            "max_time": max_time,
            "threshold": threshold,
            "invert": invert,
            "smooth": smooth,
            "despeckle": despeckle,
            "snap": snap,
        }
        outputs = output or []
        pieces.require(grammar, branches, separate=separate, outputs=outputs)
        shown = {"quiet": quiet, "as_json": as_json}
        if pictures.is_batch(images, out_dir):
            if preview is not None or report_file is not None or layers is not None or animate is not None:
                raise D4cadError(
                    "with several pictures, name previews and reports by -o .png and -o .html; no --layers or --animate"
                )
            if branches is not None or separate:
                raise D4cadError("--branches and --separate are for one picture: `d4cad export` has them for the rest")
            pictures.fit_batch(
                images, out_dir, outputs, options, finish, placement, jobs=jobs, force=force, **shown
            )  # fmt: skip
            return
        (image,) = images
        if report_file is not None:
            if report_file.suffix.lower() != ".html":
                raise D4cadError(f"a report is .html, got {report_file}")
            outputs = [*outputs, report_file]
        if layers is not None:
            if preview is not None or init is not None or animate is not None:
                raise D4cadError(
                    "--layers takes no --preview, --init or --animate: -o NAME.png has a preview of each layer"
                )
            if branches is not None or separate:
                raise D4cadError("--layers takes neither --branches nor --separate")
            pictures.fit_colors(image, layers, outputs, options, finish, placement, **shown)
            return
        check_outputs(outputs, preview, image)
        film = None
        if animate is not None:
            animation.check(animate)
            if animate.resolve() == image.resolve():
                raise D4cadError(f"cannot write {animate}: it is the picture")
            film = animation.Film()
            options["follow"] = film.follow
        with progress(max_time, shown=not (quiet or as_json)) as watch:
            found = fit_finished(image, finish, placement, watch=watch, **options)
        placement = found.placement(width, scale, dpi, origin, thickness)
        found = pieces.drawn(found, placement, branches, separate=separate)
        write(found, placement, outputs, preview)
        if film is not None and animate is not None:
            film.end(found)
            animation.write_gif(animate, film.frames)
            outputs = [*outputs, animate]
        report(found, placement, outputs, preview, quiet=quiet, as_json=as_json)
        if found.stop.name == "INTERRUPTED":
            raise typer.Exit(INTERRUPTED)
