"""`d4cad bench`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from d4cad.cli.options import Grammar, Method, Seed, Snap, Variant
from d4cad.cli.running import reported


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
    variant: Variant = None,
    method: Method = "fast",
    seed: Seed = 0,
    limit: Annotated[int | None, typer.Option(metavar="N", help="Shapes of each set.", show_default="all")] = None,
    jobs: Annotated[int, typer.Option(metavar="N", help="Processes.")] = 1,
    max_time: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds for each shape.", show_default=False)
    ] = None,
    init: Annotated[
        str | None, typer.Option(metavar="contour|axiom", help="What to start from.", show_default="as fit does")
    ] = None,
    snap: Snap = None,
) -> None:
    """Fit every shape of a folder whose truth is known, and compare."""
    with reported():
        from d4cad.bench import Request, run, table

        rows = run(Request(data, out, bitmaps, grammar, variant, method, seed, limit, jobs, max_time, init, snap))
        typer.echo(table(rows))
