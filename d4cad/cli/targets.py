"""`d4cad targets`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from d4cad.cli.options import Quiet
from d4cad.cli.running import reported


def targets(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Pickles of target shapes.")],
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="DIR", help="Folder for {FILE's name}.json.", show_default=False)
    ],
    quiet: Quiet = False,
) -> None:
    """Convert pickled target shapes to the format of bench and tables, executing nothing that is in them."""
    with reported():
        from d4cad.targets import convert

        out.mkdir(parents=True, exist_ok=True)
        for file in files:
            path = out / f"{file.stem}.json"
            count = convert(file, path)
            if not quiet:
                typer.echo(f"wrote {path}: {count} shapes")
