"""`d4cad tables`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from d4cad.cli.options import Quiet
from d4cad.cli.running import reported


def tables(
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of {set}.json files in the neutral format.", show_default="our own three sets"
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--out",
            metavar="DIR",
            help="Folder for the tables.",
            show_default="docs/results/own or /{DIR's name}",
        ),
    ] = None,
    work: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for every fit: what is there is not done again.")
    ] = Path("out/tables"),
    method: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="paper or fast; may be given twice.", show_default="both")
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A variant, such as AL-F; may be repeated.", show_default="all"),
    ] = None,
    limit: Annotated[int | None, typer.Option(metavar="N", help="Shapes of each set.", show_default="all")] = None,
    seeds: Annotated[int, typer.Option(metavar="N", help="Seeds of each fit that draws random numbers.")] = 3,
    jobs: Annotated[
        int | None, typer.Option(metavar="N", help="Processes, -1 for all cores.", show_default="1")
    ] = None,
    max_time: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds for each fit.", show_default=False)
    ] = None,
    note: Annotated[str, typer.Option(metavar="TEXT", help="A sentence for the head of the tables.")] = "",
    quiet: Quiet = False,
) -> None:
    """Run the paper's Tables 2 and 3 and its fixed-step variants, and write them as JSON, Markdown and plots."""
    with reported():
        from d4cad.progress import counted
        from d4cad.tables import plots, running, summing, writing
        from d4cad.tables.settings import settings

        rows = settings(method or ("paper", "fast"), only or ())
        todo = running.tasks(data, rows, limit, seeds, max_time)
        with counted("fits", shown=not quiet) as tell:
            results = running.run(todo, work, jobs, tell)
        found, orders = summing.cells(results), summing.claims(results)
        command = ["d4cad tables", *(["--data DIR"] if data is not None else [])]
        command += [f"--{name} {value}" for name, value in (("limit", limit), ("max-time", max_time)) if value]
        command += [f"--method {name}" for name in method or ()] + [f"--only {name}" for name in only or ()]
        facts: dict[str, Any] = {
            "command": " ".join([*command, f"--seeds {seeds}"]),
            "data": "own" if data is None else data.name,
            "limit": limit,
            "seeds": seeds,
            "fits": len(results),
            "cpu_s": sum(result.cpu_s for result in results),
            "note": note,
        }
        out = out or Path("docs/results") / facts["data"]
        files = [*writing.write(out, facts, found, orders), *plots.plot(out, found)]
        if not quiet:
            typer.echo(writing.in_words(orders))
            typer.echo("\n".join(f"wrote {path}" for path in files))
