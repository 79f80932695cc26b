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


class _State(ProgressColumn):
    """The last record and the clock; rendered several times a second, so that the clock runs between rounds."""

    max_refresh = None

    def __init__(self, max_time: float | None) -> None:
        super().__init__()
        self.started = time.perf_counter()
        self.max_time = max_time
        self.record: Record | None = None

    def render(self, task: Task) -> Text:
        """One line of text."""
        elapsed = time.perf_counter() - self.started
        parts = ["starting" if self.record is None else describe(self.record), f"{elapsed:.1f} s"]
        if self.max_time is not None:
            parts.append(f"{max(self.max_time - elapsed, 0):.0f} s left")
        return Text(" · ".join(parts))


def describe(record: Record) -> str:
    """Step, loss, PSNR and primitives of a record."""
    return f"step {record.step} · loss {record.loss:.3g} · {record.psnr:.1f} dB · {record.primitives} primitives"


@contextmanager
def live(max_time: float | None) -> Iterator[Callable[[Record], None]]:
    """Shows a line while the block runs, and takes it away afterwards; yields what updates it."""
    state = _State(max_time)

    def watch(record: Record) -> None:
        state.record = record

    with Progress(SpinnerColumn(), state, console=Console(stderr=True), transient=True) as progress:
        progress.add_task("fit", total=None)
        yield watch
