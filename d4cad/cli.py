"""The `d4cad` command. What takes long to import is imported inside the commands: help must answer at once."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from d4cad import __version__
from d4cad.errors import D4cadError

if TYPE_CHECKING:
    from d4cad.fit import Fit
    from d4cad.placement import Placement

FAILED = 2
INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it; the outputs named for a fit are written all the same."""

app = typer.Typer(
    help="A picture of a part becomes an exact CAD part of lines and arcs.",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # rich's help pages cost more time than all else in `--help`
    context_settings={"help_option_names": ["-h", "--help"]},
)

Output = Annotated[
    list[Path] | None,
    typer.Option(
        "--output",
        "-o",
        metavar="FILE",
        help="File to write: .step .stp .stl .brep .svg .json .png; repeatable.",
        show_default=False,
    ),
]
Width = Annotated[float | None, typer.Option(metavar="MM", help="Width of the part in mm.", show_default=False)]
Scale = Annotated[float | None, typer.Option(metavar="MM_PER_PX", help="Millimetres per pixel.", show_default=False)]
Dpi = Annotated[
    float | None,
    typer.Option(metavar="N", help="Pixels per inch; by default what the picture states, else 96.", show_default=False),
]
Thickness = Annotated[float | None, typer.Option(metavar="MM", help="Thickness of solids in mm.", show_default="3")]
Origin = Annotated[
    str | None, typer.Option(metavar="WHERE", help="corner or center of the part at (0, 0).", show_default="corner")
]
Grammar = Annotated[str, typer.Option(metavar="NAME", help="Language of shapes: arc-line.")]
Method = Annotated[str, typer.Option(metavar="NAME", help="fast, or paper for the published settings.")]
Seed = Annotated[int, typer.Option(metavar="N", help="Seed of all randomness.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output and nothing else.")]


def main() -> None:
    """Entry point of the `d4cad` command."""
    app()


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"d4cad {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


@app.command()
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
    with _reported():
        from d4cad.placement import Placement

        placement = Placement(width, scale, dpi, "corner" if origin is None else origin, thickness)
        outputs = output or []
        _check_outputs(outputs, preview, image)
        from d4cad.fit import fit_image

        with _progress(max_time, shown=not (quiet or as_json)) as watch:
            found = fit_image(
                image,
                method=method,
                grammar=grammar,
                init=init,
                seed=seed,
                max_time=max_time,
                threshold=threshold,
                invert=invert,
                watch=watch,
            )
        placement = found.placement(width, scale, dpi, origin, thickness)
        _write(found, placement, outputs, preview)
        _report(found, placement, outputs, preview, quiet=quiet, as_json=as_json)
        if found.stop.name == "INTERRUPTED":
            raise typer.Exit(INTERRUPTED)


@app.command()
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
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Write CAD files from a program file. Size, origin and thickness are the file's unless given."""
    with _reported():
        from d4cad.placement import Placement

        Placement(width, scale, dpi, "corner" if origin is None else origin, thickness)
        outputs = output or []
        if not outputs:
            raise D4cadError("there is nothing to write: name a file with -o")
        _check_outputs(outputs, None, None)
        from d4cad.fit import load_program

        found = load_program(program)
        placement = found.placement(width, scale, dpi, origin, thickness)
        _write(found, placement, outputs, None)
        _report(found, placement, outputs, None, quiet=quiet, as_json=as_json)


@app.command()
def bench(
    data: Annotated[
        Path,
        typer.Argument(
            metavar="DATA_DIR", help="Folder of {set}.json files in the neutral format.", show_default=False
        ),
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for {set}_{index:03d}.json.", show_default=False)],
    bitmaps: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of {set}_{index:03d}.png to fit in place of exact rasters.", show_default=False
        ),
    ] = None,
    grammar: Grammar = "arc-line",
    method: Method = "fast",
    seed: Seed = 0,
    limit: Annotated[int | None, typer.Option(metavar="N", help="Shapes of each set.", show_default="all")] = None,
    jobs: Annotated[int, typer.Option(metavar="N", help="Processes.")] = 1,
    max_time: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds for each shape.", show_default=False)
    ] = None,
) -> None:
    """Fit every shape of a folder whose truth is known, and compare."""
    with _reported():
        from d4cad.bench import Request, run, table

        rows = run(Request(data, out, bitmaps, grammar, method, seed, limit, jobs, max_time))
        typer.echo(table(rows))


@contextmanager
def _reported() -> Iterator[None]:
    """Turns the errors that a user can cause into one sentence and an exit code."""
    try:
        yield
    except (D4cadError, OSError) as error:
        typer.echo(f"error: {_sentence(error)}", err=True)
        raise typer.Exit(FAILED) from None
    except MemoryError:
        typer.echo("error: there is not enough memory for this", err=True)
        raise typer.Exit(FAILED) from None
    except KeyboardInterrupt:
        typer.echo("interrupted: nothing more was written", err=True)
        raise typer.Exit(INTERRUPTED) from None


def _sentence(error: D4cadError | OSError) -> str:
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split())


def _check_outputs(outputs: list[Path], preview: Path | None, image: Path | None) -> None:
    """Refuses, before anything is computed, outputs that could not be written or that would take each other's place."""
    from d4cad.exporters.preview import require_format
    from d4cad.files import check_writable
    from d4cad.outputs import check_output

    for path in outputs:
        check_output(path, has_picture=image is not None)
    if preview is not None:
        require_format(preview)
        check_writable(preview)
    taken = {image.resolve(): "the picture"} if image is not None else {}
    for path in [*outputs, *([] if preview is None else [preview])]:
        if path.resolve() in taken:
            raise D4cadError(f"cannot write {path}: it is {taken[path.resolve()]}")
        taken[path.resolve()] = "named for two outputs"


def _write(fit: Fit, placement: Placement, outputs: list[Path], preview: Path | None) -> None:
    for path in outputs:
        fit.write(path, placement)
    if preview is not None:
        fit.write_preview(preview)


def _report(
    fit: Fit, placement: Placement, outputs: list[Path], preview: Path | None, *, quiet: bool, as_json: bool
) -> None:
    """The summary, as text or as one JSON object."""
    from d4cad.summary import summary, text

    if quiet and not as_json:
        return
    files = [*outputs, *([] if preview is None else [preview])]
    facts = summary(fit, placement, files)
    typer.echo(json.dumps(facts, allow_nan=False) if as_json else text(facts))


@contextmanager
def _progress(max_time: float | None, *, shown: bool) -> Iterator[Any]:
    """A function that shows each record of a running fit on the terminal; None where nobody looks on."""
    import sys

    if not (shown and sys.stderr.isatty()):
        yield None
        return
    from d4cad.progress import live

    with live(max_time) as watch:
        yield watch


if __name__ == "__main__":
    main()
