"""`d4cad grammar-report`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from d4cad.cli.options import Json, Quiet, Seed
from d4cad.cli.running import reported


def grammar_report(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", help="A grammar, as `d4cad grammars` lists them, or FILE.py:OBJECT.", show_default=False
        ),
    ],
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The report as .md or .json, its picture as .png or .svg; repeatable.",
            show_default=False,
        ),
    ] = None,
    programs: Annotated[int, typer.Option(metavar="N", help="Random programs.")] = 24,
    pixels: Annotated[int, typer.Option(metavar="N", help="Pixels along the canvas.")] = 128,
    seed: Seed = 0,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Measure a grammar on random programs: reversibility, jump continuity, local control, repairability.

    Which rewrites can be undone and how exactly, by how much each changes the shape, how much of the boundary it and
    single parameters reach, and what repair does to programs whose parameters were thrown about.
    """
    with reported():
        from d4cad.progress import counted
        from d4cad.properties import measure
        from d4cad.propertypages import check, facts, text, write

        outputs = output or []
        check(outputs)
        with counted("programs", shown=not (quiet or as_json)) as tell:
            report = measure(name, programs=programs, seed=seed, pixels=pixels, tell=tell)
        for path in outputs:
            write(report, path)
        if as_json:
            typer.echo(json.dumps({**facts(report), "files": [str(path) for path in outputs]}, allow_nan=False))
        elif not quiet:
            typer.echo("\n".join([text(report), *(f"wrote {path}" for path in outputs)]))
