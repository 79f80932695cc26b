"""`d4cad text`."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from d4cad.cli.options import Dpi, Grammar, Json, Origin, Output, Quiet, Scale, Seed, Thickness, Width
from d4cad.cli.running import INTERRUPTED, check_outputs, progress, reported, write
from d4cad.errors import D4cadError

if TYPE_CHECKING:
    from d4cad.descent import Record
    from d4cad.fit import Fit
    from d4cad.text import Candidate

LIVE_EVERY = 0.5
"""Seconds between live pictures."""

LIVE_SIDE = 512
"""Pixels along a live picture."""


def text(
    prompt: Annotated[
        str, typer.Argument(metavar="PROMPT", help="What the part shall look like: star.", show_default=False)
    ],
    output: Output = None,
    preview: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="What the prior sees, outline and error as .png or .svg.", show_default=False
        ),
    ] = None,
    sheet: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Contact sheet of all candidates, best first, .png .svg.", show_default=False
        ),
    ] = None,
    live: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A .png kept up to date while it works.", show_default=False)
    ] = None,
    grammar: Grammar = "arc-line",
    prior: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="embedded, learned, learned:WEIGHTS, or sd:FOLDER for a Stable Diffusion pipeline."
        ),
    ] = "embedded",
    candidates: Annotated[int, typer.Option(metavar="K", help="Designs to make; outputs get the best.")] = 1,
    steps: Annotated[int, typer.Option(metavar="N", help="Gradient steps for each.")] = 200,
    seed: Seed = 0,
    negative: Annotated[
        str, typer.Option(metavar="TEXT", help="What it shall not look like.", show_default=False)
    ] = "",
    guidance: Annotated[
        float | None,
        typer.Option(metavar="G", help="How strictly the prompt is followed.", show_default="7, or 100 for sd:"),
    ] = None,
    weighting: Annotated[str, typer.Option(metavar="NAME", help="Weight of a noise level: x0, sds or snr.")] = "x0",
    init: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Program file to go on from.", show_default=False)
    ] = None,
    device: Annotated[str, typer.Option(metavar="NAME", help="Where learned and sd: run, such as cuda.")] = "cpu",
    dtype: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="float32, float16 or bfloat16; sd:.", show_default="float16 on cuda, else float32"
        ),
    ] = None,
    max_time: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds after which the search ends.", show_default=False)
    ] = None,
    width: Width = None,
    scale: Scale = None,
    dpi: Dpi = None,
    thickness: Thickness = None,
    origin: Origin = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Design a part that looks like what a prompt says, 50 mm wide unless a size is given.

    Ctrl-C ends the search early: the outputs get the best part so far, exit code 130. --init goes on
    from a .json output.
    """
    with reported():
        from d4cad.placement import Placement

        Placement(width, scale, dpi, "corner" if origin is None else origin, thickness)
        outputs = output or []
        check_outputs(outputs, preview, Path("/"))  # there will be a picture: what the prior sees
        _check_pictures([*outputs, *([preview] if preview else [])], sheet, live)

        from d4cad.text import fit_text

        with progress(max_time, shown=not (quiet or as_json), quality=_pull) as watch:
            found = fit_text(
                prompt, grammar=grammar, prior=prior, steps=steps, seed=seed, candidates=candidates, negative=negative,
                guidance=guidance, weighting=weighting, init=init, device=device, dtype=dtype, max_time=max_time,
                watch=_watch(watch, live),
            )  # fmt: skip
        best = found[0].fit
        placement = best.placement(width, scale, dpi, origin, thickness)
        write(best, placement, outputs, preview)
        if sheet is not None:
            from d4cad.exporters.sheet import write_sheet

            write_sheet(sheet, [candidate.fit.outline for candidate in found], [_caption(one) for one in found])
        if live is not None:
            _draw(best, live)
        if as_json or not quiet:
            from d4cad.summary import summary
            from d4cad.summary import text as told

            facts = summary(best, placement, [*outputs, *(path for path in (preview, sheet, live) if path)])
            facts["seed"] = found[0].seed
            facts["candidates"] = [
                {"seed": one.seed, "score": one.score, "primitives": one.fit.primitives} for one in found
            ]
            typer.echo(json.dumps(facts, allow_nan=False) if as_json else "\n".join([*_ranking(found), told(facts)]))
        if any(candidate.fit.stop.name == "INTERRUPTED" for candidate in found):
            raise typer.Exit(INTERRUPTED)


def _check_pictures(taken: list[Path], *pictures: Path | None) -> None:
    """Refuses, before anything is computed, pictures that could not be written or that another output is named for."""
    from d4cad.exporters.preview import require_format
    from d4cad.files import check_writable

    names = {path.resolve() for path in taken}
    for path in [path for path in pictures if path is not None]:
        require_format(path)
        check_writable(path)
        if path.resolve() in names:
            raise D4cadError(f"cannot write {path}: it is named for two outputs")
        names.add(path.resolve())
    live = pictures[-1]
    if live is not None and live.suffix.lower() != ".png":
        raise D4cadError(f"a live picture is .png, got {live}")


def _pull(record: Record) -> str:
    """How far the shape is from what the prior wants."""
    return f"loss {record.loss:.3g}"


def _watch(shown: Callable[[Record], None] | None, live: Path | None) -> Callable[[Record, Fit], None] | None:
    """What a search tells of each round: the line on the terminal, and the live picture now and then."""
    if shown is None and live is None:
        return None
    drawn = [0.0]

    def watch(record: Record, fit: Fit) -> None:
        if shown is not None:
            shown(record)
        if live is not None and time.monotonic() - drawn[0] > LIVE_EVERY:
            _draw(fit, live)
            drawn[0] = time.monotonic()

    return watch


def _draw(fit: Fit, path: Path) -> None:
    """The shape, black on white."""
    import numpy as np
    from PIL import Image

    from d4cad.files import replacing

    picture: Any = Image.fromarray(np.round(255 * (1 - fit.coverage[::-1])).astype(np.uint8))
    with replacing(path) as temporary:
        picture.resize((LIVE_SIDE, LIVE_SIDE), Image.Resampling.BICUBIC).save(temporary)


def _caption(candidate: Candidate) -> str:
    fit = candidate.fit
    return f"seed {candidate.seed}: {fit.primitives} {fit.counted or 'primitive'}s"


def _ranking(found: Sequence[Candidate]) -> list[str]:
    """A line for each candidate, where there are several."""
    if len(found) == 1:
        return []
    return [f"{place}. {_caption(one)}, distance {one.score:.4g}" for place, one in enumerate(found, 1)]
