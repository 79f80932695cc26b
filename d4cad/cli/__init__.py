"""The `d4cad` command, one module a command.

What takes long to import is imported inside the commands: help must answer at once.
"""

from __future__ import annotations

from typing import Annotated

import typer

from d4cad import __version__
from d4cad.cli import (
    beam,
    bench,
    check,
    combine,
    doctor,
    export,
    fit,
    grammar_report,
    grammars,
    morph,
    simplify,
    tables,
    targets,
    text,
)

app = typer.Typer(
    help="A picture of a part becomes an exact CAD part of lines and arcs.",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # rich's help pages cost more time than all else in `--help`
    context_settings={"help_option_names": ["-h", "--help"]},
)


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


for _command in (
    fit.fit,
    text.text,
    beam.beam,
    export.export,
    simplify.simplify,
    check.check,
    combine.combine,
    doctor.doctor,
    bench.bench,
    tables.tables,
    targets.targets,
    morph.morph,
    grammars.grammars,
    grammar_report.grammar_report,
):
    app.command()(_command)
