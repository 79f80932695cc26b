"""`d4cad check`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from d4cad.cli.options import Json, Quiet, Thickness
from d4cad.cli.running import reported

if TYPE_CHECKING:
    from d4cad.exporters.checks import Report

FAILED = 1
"""Exit code when a check fails; 2 is for input that cannot be checked."""


def check(
    program: Annotated[
        Path, typer.Argument(metavar="PROGRAM", help="Program file or drawing of the part.", show_default=False)
    ],
    process: Annotated[
        str, typer.Option(metavar="NAME", help="laser, cnc or fdm: which checks, and limits.")
    ] = "laser",
    min_wall: Annotated[
        float | None, typer.Option(metavar="MM", help="Least width of material.", show_default="the process's")
    ] = None,
    min_gap: Annotated[
        float | None, typer.Option(metavar="MM", help="Least width of holes and slots.", show_default="the process's")
    ] = None,
    min_feature: Annotated[
        float | None, typer.Option(metavar="MM", help="Least edge and hole diameter.", show_default="the process's")
    ] = None,
    tool_diameter: Annotated[
        float | None, typer.Option(metavar="MM", help="Diameter of the cutter.", show_default="the process's")
    ] = None,
    kerf: Annotated[
        float | None, typer.Option(metavar="MM", help="Width of the beam's cut.", show_default="the process's")
    ] = None,
    bed: Annotated[
        str | None, typer.Option(metavar="WxH", help="Size of the machine's bed in mm.", show_default="the process's")
    ] = None,
    bodies: Annotated[
        int | None, typer.Option(metavar="N", help="Number of separate bodies.", show_default="the process's")
    ] = None,
    thickness: Thickness = None,
    others: Annotated[
        list[Path] | None,
        typer.Option(
            "--with", metavar="FILE", help="Program file of a part beside it; repeatable.", show_default=False
        ),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Outline with the places marked, .png or .svg.", show_default=False),
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Check whether a part can be made, and where it cannot. Exit code 1 when a check fails."""
    with reported():
        from d4cad.cli.parts import pair, read_loops, read_part, read_thickness
        from d4cad.exporters import checks
        from d4cad.exporters.checks.picture import write_picture
        from d4cad.exporters.preview import require_format
        from d4cad.files import check_writable
        from d4cad.placement import DEFAULT_THICKNESS

        usual = checks.process(process)
        given = {
            "min_wall": min_wall,
            "min_gap": min_gap,
            "min_feature": min_feature,
            "tool_diameter": tool_diameter,
            "kerf": kerf,
            "bed": None if bed is None else pair(bed.lower(), "x", "--bed"),
            "bodies": bodies,
        }
        height = thickness or read_thickness(program) or DEFAULT_THICKNESS
        limits = usual.limits.given(**given, thickness=height if thickness is None else thickness)
        if picture is not None:
            require_format(picture)
            check_writable(picture)
        beside = [read_part(path) for path in others or []]
        wanted = {*usual.checks, *(OF_LIMIT[name] for name, value in given.items() if value is not None)}
        wanted |= {"interference", "clearance"} if beside else set()
        names = [name for name in checks.CHECKS if name in wanted]
        report = checks.check_loops(read_loops(program), limits, names, beside)
        if picture is not None:
            write_picture(picture, report)
        if as_json:
            facts = {"program": str(program), "process": process, **report.to_dict()}
            typer.echo(json.dumps({**facts, "picture": None if picture is None else str(picture)}, allow_nan=False))
        elif not quiet:
            _show(report, picture)
        if not report.passed:
            raise typer.Exit(FAILED)


OF_LIMIT = {
    "min_wall": "minimum wall",
    "min_gap": "minimum gap",
    "min_feature": "smallest feature",
    "tool_diameter": "inside corners",
    "kerf": "kerf",
    "bed": "bed",
    "bodies": "bodies",
}
"""The check that each limit is for: a limit given by name is checked whatever the process."""


def _show(report: Report, picture: Path | None) -> None:
    """The findings as a table, as wide as the terminal."""
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for title in ("check", "result", "measured", "limit", ""):
        table.add_column(title, justify="right" if title in ("measured", "limit") else "left", no_wrap=title != "")
    colors = {"passed": "green", "failed": "bold red", "not checked": "yellow"}
    for finding in report.findings:
        unit = f" {finding.unit}" if finding.unit else ""
        numbers = ("" if x is None else f"{x:.4g}{unit}" for x in (finding.measured, finding.limit))
        status = finding.status.value
        table.add_row(finding.name, f"[{colors[status]}]{status}[/]", *numbers, finding.message)
    Console(highlight=False).print(table)
    if picture is not None:
        typer.echo(f"wrote {picture}")
