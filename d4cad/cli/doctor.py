"""`d4cad doctor`."""

from __future__ import annotations

import typer

from d4cad.cli.options import Json
from d4cad.cli.running import reported

BROKEN = 1


def doctor(as_json: Json = False) -> None:
    """Tell which CAD kernels work here, and how to mend the others. Exit code 1 if one is broken or none works."""
    with reported():
        from d4cad import doctor

        report = doctor.examine()
        typer.echo(doctor.as_json(report) if as_json else doctor.text(report))
        if not report.healthy:
            raise typer.Exit(BROKEN)
