"""The live line of a running fit, on standard error."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Progress, ProgressColumn, SpinnerColumn, Task
from rich.text import Text

if TYPE_CHECKING:
    from d4cad.descent import Record

Quality = Callable[["Record"], str]

PATIENCE = 5.0
"""Seconds without a record after which a new user wants to know what takes so long."""


class _State(ProgressColumn):
    """The last record and the clock; drawn several times a second, so that the clock runs between rounds."""

    max_refresh = None

    def __init__(self, max_time: float | None, quality: Quality) -> None:
        super().__init__()
        self.max_time = max_time
        self.quality = quality
        self.began = time.perf_counter()
        self.record: Record | None = None

    def watch(self, record: Record) -> None:
        """Take on a new record, and its clock: the search may have begun after this line."""
        self.record = record
        self.began = time.perf_counter() - record.seconds

    def render(self, task: Task) -> Text:
        """One line of text."""
        return Text(line(self.record, time.perf_counter() - self.began, self.max_time, self.quality))


def likeness(record: Record) -> str:
    """How well a picture is met."""
    return f"loss {record.loss:.3g} · {record.psnr:.1f} dB"


def line(record: Record | None, elapsed: float, max_time: float | None, quality: Quality = likeness) -> str:
    """Step, quality and primitives of the last record, seconds so far, and seconds left if there is a limit."""
    if record is None:
        return "starting" if elapsed < PATIENCE else "starting: the first run compiles, which takes a while"
    parts = [
        f"step {record.step}",
        quality(record),
        f"{record.primitives} primitives",
        f"{elapsed:.1f} s",
    ]
    if max_time is not None:
        parts.append(f"{max(max_time - elapsed, 0):.0f} s left")
    return " · ".join(parts)


@contextmanager
def live(max_time: float | None, quality: Quality = likeness) -> Iterator[Callable[[Record], None]]:
    """Shows a line while the block runs, and takes it away afterwards; yields what updates it.

    quality: words for how good a record is.
    """
    state = _State(max_time, quality)
    with Progress(SpinnerColumn(), state, console=Console(stderr=True), transient=True) as progress:
        progress.add_task("fit", total=None)
        yield state.watch


@contextmanager
def counted(what: str, *, shown: bool) -> Iterator[Callable[[int, int], None] | None]:
    """A bar for many things of one kind, moved by (done, all); None where nobody looks on."""
    console = Console(stderr=True)
    if not (shown and console.is_terminal):
        yield None
        return
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(what, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)
