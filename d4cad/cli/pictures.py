"""Options of `d4cad fit` on the picture and on the outline, and fits of several pictures or of several colours."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from d4cad.cli.running import FAILED, INTERRUPTED, check_outputs, progress
from d4cad.errors import D4cadError

if TYPE_CHECKING:
    from d4cad.batch import Row
    from d4cad.finishing import Finish
    from d4cad.placement import Placement

Threshold = Annotated[
    str | None,
    typer.Option(
        metavar="T",
        help="auto keeps antialiased grey; adaptive does in uneven light; otsu or a level 0 to 1 makes it binary.",
        show_default="auto",
    ),
]
Smooth = Annotated[float, typer.Option(metavar="PX", help="Blur the picture first, by a Gaussian of so many pixels.")]
Despeckle = Annotated[int, typer.Option(metavar="N", help="Drop specks and fill pinholes of fewer than N pixels.")]
ToleranceOf = Annotated[
    str | None,
    typer.Option(
        "--tolerance",
        metavar="LENGTH",
        help="How far the outline may leave the picture's edge for fewer primitives: 0.5px, 0.1mm.",
        show_default=False,
    ),
]
LinesOnly = Annotated[bool, typer.Option("--lines-only", help="No arcs: polygons within the tolerance, or 0.25 px.")]
ArcsOnly = Annotated[bool, typer.Option("--arcs-only", help="No lines: straight sides become very flat arcs.")]
MinRadius = Annotated[
    str | None,
    typer.Option(metavar="LENGTH", help="Arcs of less radius become corners or lines: 2px, 1mm.", show_default=False),
]
MinFeature = Annotated[
    str | None, typer.Option(metavar="LENGTH", help="Loops and holes of less extent go.", show_default=False)
]
Layers = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help="Take a colour picture apart: a sketch for each of N colours beside the ground. NAME-1.step and so on; "
        ".svg and .dxf hold them all.",
        show_default=False,
    ),
]
ReportFile = Annotated[
    Path | None,
    typer.Option("--report", metavar="FILE", help="One page of HTML: overlay, deviation, tables.", show_default=False),
]
OutDir = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Folder for several pictures; -o then names kinds only: -o .step -o .json (default .json).",
        show_default=False,
    ),
]
Jobs = Annotated[int, typer.Option(metavar="N", help="Pictures at a time, -1 for every core; with --out-dir.")]
Force = Annotated[bool, typer.Option("--force", help="Fit again what --out-dir has already.")]


def is_batch(images: Sequence[Path], out_dir: Path | None) -> bool:
    """Whether images are to be fitted each into a folder."""
    return (
        out_dir is not None or len(images) > 1 or (any(c in str(images[0]) for c in "*?[") and not images[0].exists())
    )


def fit_batch(
    images: Sequence[Path],
    out_dir: Path | None,
    outputs: Sequence[Path],
    options: Mapping[str, Any],
    finish: Finish,
    placement: Placement,
    *,
    jobs: int,
    force: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Fits pictures into a folder. Exit code 2 if any failed, 130 after Ctrl-C."""
    if out_dir is None:
        raise D4cadError("several pictures need a folder: give --out-dir DIR")
    from d4cad.batch import SHEET, TABLE, Batch, pictures, run

    kinds = tuple(dict.fromkeys(_extension(path) for path in outputs)) or (".json",)
    batch = Batch(out_dir, kinds, options, finish, placement)
    files = pictures(images)
    with _bar(len(files), shown=not (quiet or as_json)) as tell:
        rows = run(batch, files, jobs=jobs, force=force, tell=tell)
    counts = {status: sum(row.status == status for row in rows) for status in ("done", "skipped", "failed")}
    interrupted = any(row.status == "interrupted" for row in rows)
    tables = [str(out_dir / TABLE), str(out_dir / SHEET)]
    if as_json:
        from dataclasses import asdict

        typer.echo(json.dumps({**counts, "rows": [asdict(row) for row in rows], "files": tables}, allow_nan=False))
    else:
        for row in rows:
            if row.status == "failed":
                typer.echo(f"error: {row.picture}: {row.error}", err=True)
        if not quiet:
            typer.echo(", ".join(f"{n} {status}" for status, n in counts.items()))
            for table in tables:
                typer.echo(f"wrote {table}")
    if interrupted:
        typer.echo("interrupted: run it again to go on", err=True)
        raise typer.Exit(INTERRUPTED)
    if counts["failed"]:
        raise typer.Exit(FAILED)


def _extension(path: Path) -> str:
    """The kind that `-o .step` names."""
    if path.suffix or not path.name.startswith(".") or path.parent != Path("."):
        raise D4cadError(f"with --out-dir, -o names a kind of file such as .step, got {path}")
    return path.name.lower()


class _bar:
    """A progress bar on standard error, where somebody looks on; calls it with each row."""

    def __init__(self, total: int, *, shown: bool) -> None:
        import sys

        self.total = total
        self.shown = shown and sys.stderr.isatty()
        self.progress: Any = None

    def __enter__(self) -> _bar:
        if self.shown:
            from rich.console import Console
            from rich.progress import Progress

            self.progress = Progress(console=Console(stderr=True), transient=True)
            self.progress.start()
            self.task = self.progress.add_task("pictures", total=self.total)
        return self

    def __exit__(self, *_: object) -> None:
        if self.progress is not None:
            self.progress.stop()

    def __call__(self, row: Row) -> None:
        if self.progress is not None:
            self.progress.update(self.task, advance=1, description=Path(row.picture).name)


def fit_colors(
    image: Path,
    count: int,
    outputs: list[Path],
    options: Mapping[str, Any],
    finish: Finish,
    placement: Placement,
    *,
    quiet: bool,
    as_json: bool,
) -> None:
    """Fits each colour of a picture and writes the outputs: .svg and .dxf whole, the others one for each colour."""
    from d4cad import exporters
    from d4cad.exporters.layered import FORMATS, write_layered
    from d4cad.finishing import finished
    from d4cad.layers import fit_layers, together
    from d4cad.summary import census

    check_outputs(outputs, None, image)
    left_out = {"threshold": "--threshold", "invert": "--invert"}
    for name, flag in left_out.items():
        if options.get(name):
            raise D4cadError(f"{flag} makes two levels of a picture, --layers takes its colours: leave one out")
    known = {name: value for name, value in options.items() if name not in left_out}
    known["init"] = None
    with progress(options.get("max_time"), shown=not (quiet or as_json)) as watch:
        fits = fit_layers(image, count, watch=watch, each=lambda fit: finished(fit, finish, placement), **known)
    if placement.origin == "drawing":
        raise D4cadError("layers have no drawing's origin: expected corner or center")
    first = fits[0][1]
    given = first.placement(placement.width, placement.scale, placement.dpi, placement.origin, placement.thickness)
    common = together([fit for _, fit in fits], given)
    sketches = [common.place(fit.outline, fit.canvas) for _, fit in fits]
    files: list[str] = []
    for path in outputs:
        if path.suffix.lower() in FORMATS:
            write_layered([(color, sketch) for (color, _), sketch in zip(fits, sketches, strict=True)], path)
            files.append(str(path))
            continue
        for k, (color, fit) in enumerate(fits, 1):
            numbered = path.with_stem(f"{path.stem}-{k}")
            fit.write(numbered, common, exporters.heeded(numbered, exporters.Options(color=color)))
            files.append(str(numbered))
    facts = [
        {"layer": k, "color": color, "primitives": fit.primitives, **census(sketch), "psnr": fit.psnr,
         "area_mm2": sketch.area, "bounds_mm": list(sketch.bounds)}
        for k, ((color, fit), sketch) in enumerate(zip(fits, sketches, strict=True), 1)
    ]  # fmt: skip
    if as_json:
        typer.echo(json.dumps({"layers": facts, "files": files}, allow_nan=False))
    elif not quiet:
        for fact in facts:
            typer.echo(
                f"layer {fact['layer']} {fact['color']}: {fact['primitives']} primitives, {fact['psnr']:.1f} dB, "
                f"{fact['area_mm2']:.6g} mm2"
            )
        if len(fits) < count:
            typer.echo(
                f"note: {count} layers were asked for, but only {len(fits)} found beside the ground; in noise, "
                "--smooth 1.5 tells more colours apart"
            )
        for name in files:
            typer.echo(f"wrote {name}")
    if any(fit.stop.name == "INTERRUPTED" for _, fit in fits):
        raise typer.Exit(INTERRUPTED)
