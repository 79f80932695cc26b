"""`d4cad beam`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from d4cad.cli.options import Json, Quiet, Seed
from d4cad.cli.running import INTERRUPTED, progress, reported
from d4cad.errors import D4cadError, InputError

if TYPE_CHECKING:
    from d4cad.descent import Record


def beam(
    problem: Annotated[
        str,
        typer.Argument(
            metavar="PROBLEM",
            help="cantilever, mbb, mbb-half, l-bracket, bridge or a .toml file.",
            show_default=False,
        ),
    ],
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="File to write: .json or a CAD file as of `d4cad fit`; repeatable.",
            show_default=False,
        ),
    ] = None,
    preview: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Problem, design with stress, search as .png or .svg.", show_default=False),
    ] = None,
    volume: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="Of the domain that may be material.", show_default="the problem's"),
    ] = None,
    thickness: Annotated[
        float | None, typer.Option(metavar="MM", help="Thickness of the part in mm.", show_default="the problem's")
    ] = None,
    element: Annotated[
        float | None,
        typer.Option(metavar="MM", help="Side of the elements of the design's grid.", show_default="the problem's"),
    ] = None,
    grammar: Annotated[str, typer.Option(metavar="NAME", help="Shapes: arc-line or union-rect.")] = "arc-line",
    simplify: Annotated[
        str | None,
        typer.Option(
            metavar="PERCENT", help="Compliance to give up for fewer primitives, such as 1%.", show_default=False
        ),
    ] = None,
    fillet: Annotated[
        float | None, typer.Option(metavar="MM", help="Radius of inside corners, for a cutter.", show_default=False)
    ] = None,
    method: Annotated[
        str, typer.Option(metavar="NAME", help="fast, or paper for the published set-ups on 64 x 64 elements.")
    ] = "fast",
    init: Annotated[
        str, typer.Option(metavar="density|axiom", help="Start from an optimised density or from the full domain.")
    ] = "density",
    seed: Seed = 0,
    max_time: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds after which the search ends.", show_default=False)
    ] = None,
    compare_simp: Annotated[
        bool, typer.Option("--compare-simp", help="Run SIMP at the same volume too and compare.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Design the stiffest part for a load. Ctrl-C ends the search early: outputs get the best part, exit code 130."""
    with reported():
        from dataclasses import replace

        from d4cad.beams.library import find_problem

        outputs = output or []
        found = find_problem(problem, volume)
        if thickness is not None:
            found = replace(found, thickness=thickness)
        if element is not None:
            found = replace(found, element=element)
        share = None if simplify is None else _share(simplify)
        if method not in ("fast", "paper"):
            raise InputError(f"there is no method {method!r}, expected one of: fast, paper")
        if method == "paper":
            asked_for = {
                "--volume": volume, "--element": element, "--simplify": simplify, "--fillet": fillet,
                "--grammar": None if grammar == "arc-line" else grammar, "--init": None if init == "density" else init,
            }  # fmt: skip
            _check_fixed(asked_for)
        _check_outputs(outputs, preview, found.thickness, problem)

        from d4cad.beams.design import design_beam
        from d4cad.beams.paper import paper_beam
        from d4cad.beams.report import carried, report, text
        from d4cad.beams.saving import save

        says = "compliance over the full domain's" if method == "fast" else "the paper's loss"
        with progress(max_time, shown=not (quiet or as_json), quality=lambda record: _quality(record, says)) as watch:
            if method == "paper":
                part = paper_beam(problem, seed=seed, max_time=max_time, watch=watch)
                part = replace(part, problem=replace(part.problem, thickness=found.thickness))
            else:
                part = design_beam(
                    found, grammar=grammar, init=init, simplify=share, fillet=fillet, seed=seed, max_time=max_time,
                    watch=watch,
                )  # fmt: skip
        fine = carried(part)
        asked = {"grammar": grammar, "method": method, "init": init, "simplify": share, "fillet": fillet, "seed": seed}
        for path in outputs:
            save(part, path, asked)
        if preview is not None:
            from d4cad.beams.pictures import design_panel, history_panel, problem_panel, write_picture

            panels = [
                problem_panel(part.problem),
                design_panel(part.problem, part.outline, fine),
                history_panel(part.history, says),
            ]
            write_picture(preview, panels)
        if as_json or not quiet:
            files = [*outputs, *([] if preview is None else [preview])]
            facts = {**report(part, fine, simp=compare_simp, files=files), **asked}
            typer.echo(json.dumps(facts, allow_nan=False) if as_json else text(facts))
        if part.stop.name == "INTERRUPTED":
            raise typer.Exit(INTERRUPTED)


def _quality(record: Record, says: str) -> str:
    """What the search minimises, and what it is now."""
    return f"{says} {record.loss:.4g}"


def _share(text: str) -> float:
    """The share that "1%" or "0.01" means."""
    try:
        value = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        raise InputError(f"expected a share such as 1% or 0.01 to simplify at, got {text!r}") from None
    if not 0 <= value < 1:
        raise InputError(f"the compliance given up must be from 0% to less than 100%, got {text}")
    return value


def _check_fixed(asked: Mapping[str, object]) -> None:
    """Refuses what a published set-up leaves no choice of."""
    for name, value in asked.items():
        if value is not None:
            raise InputError(f"the paper's set-ups are as published: {name} cannot be combined with --method paper")


def _check_outputs(outputs: list[Path], preview: Path | None, thickness: float, problem: str) -> None:
    """Refuses, before anything is computed, outputs that could not be written or that would take each other's place."""
    from d4cad.beams.saving import check_output
    from d4cad.exporters.preview import require_format
    from d4cad.files import check_writable

    for path in outputs:
        check_output(path, thickness)
    if preview is not None:
        require_format(preview)
        check_writable(preview)
    taken = {Path(problem).resolve(): "the problem"}
    for path in [*outputs, *([] if preview is None else [preview])]:
        if path.resolve() in taken:
            raise D4cadError(f"cannot write {path}: it is {taken[path.resolve()]}")
        taken[path.resolve()] = "named for two outputs"
