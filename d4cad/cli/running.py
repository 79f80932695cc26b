"""What every command does around its own work: one sentence for an error, outputs checked and written, a report."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from d4cad.errors import D4cadError

if TYPE_CHECKING:
    from d4cad.exporters import Options
    from d4cad.exporters.form import Form
    from d4cad.fit import Fit
    from d4cad.placement import Placement

FAILED = 2
INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it; the outputs named for a fit are written all the same."""


@contextmanager
def reported() -> Iterator[None]:
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


def check_outputs(
    outputs: list[Path], preview: Path | None, image: Path | None, options: Options | None = None
) -> None:
    """Refuses, before anything is computed, outputs that could not be written or that would take each other's place.

    Each option must be of use to one of the outputs.
    """
    from d4cad.exporters import Options, heeded, takers
    from d4cad.exporters.preview import require_format
    from d4cad.files import check_writable
    from d4cad.outputs import check_output

    options = options or Options()
    for path in outputs:
        check_output(path, has_picture=image is not None, options=heeded(path, options))
    for name in options.given:
        if not any(name in heeded(path, options).given for path in outputs):
            raise D4cadError(f"no output takes a {name}, only {takers(name)} files do")
    if preview is not None:
        require_format(preview)
        check_writable(preview)
    taken = {image.resolve(): "the picture"} if image is not None else {}
    for path in [*outputs, *([] if preview is None else [preview])]:
        if path.resolve() in taken:
            raise D4cadError(f"cannot write {path}: it is {taken[path.resolve()]}")
        taken[path.resolve()] = "named for two outputs"


def write(
    fit: Fit, placement: Placement, outputs: list[Path], preview: Path | None, options: Options | None = None
) -> None:
    """Writes every output, each with those of the options that it takes."""
    from d4cad.exporters import heeded

    for path in outputs:
        fit.write(path, placement, None if options is None else heeded(path, options))
    if preview is not None:
        fit.write_preview(preview)


def report(
    fit: Fit,
    placement: Placement,
    outputs: list[Path],
    preview: Path | None,
    *,
    quiet: bool,
    as_json: bool,
    notes: tuple[str, ...] = (),
    form: Form | None = None,
) -> None:
    """The summary, as text or as one JSON object; ``notes``: sentences for it beside the fit's own."""
    from d4cad.exporters.form import PLAIN
    from d4cad.summary import summary, text

    if quiet and not as_json:
        return
    files = [*outputs, *([] if preview is None else [preview])]
    facts = summary(fit, placement, files, form or PLAIN)
    facts["notes"] += notes
    typer.echo(json.dumps(facts, allow_nan=False) if as_json else text(facts))


@contextmanager
def progress(max_time: float | None, *, shown: bool, quality: Callable[[Any], str] | None = None) -> Iterator[Any]:
    """A function that shows each record of a running fit on the terminal; None where nobody looks on.

    quality: words for how good a record is; a picture's by default.
    """
    import sys

    if not (shown and sys.stderr.isatty()):
        yield None
        return
    from d4cad.progress import likeness, live

    with live(max_time, quality or likeness) as watch:
        yield watch
