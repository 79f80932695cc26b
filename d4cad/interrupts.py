"""Ctrl-C at a moment of our choosing: inside a compiled kernel it would surface as that kernel's SystemError."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType


@dataclass
class Interrupts:
    """Whether Ctrl-C was pressed since the block began."""

    pressed: bool = False

    def check(self) -> None:
        """Raises KeyboardInterrupt if it was: to be called where work can stop."""
        if self.pressed:
            raise KeyboardInterrupt


@contextmanager
def postponed() -> Iterator[Interrupts]:
    """Within the block the first Ctrl-C waits for :meth:`Interrupts.check`; a second one interrupts at once.

    Other handlers of the signal than Python's own are left alone, and so are threads that get no signals.
    """
    interrupts = Interrupts()

    def note(number: int, frame: FrameType | None) -> None:
        interrupts.pressed = True
        signal.signal(signal.SIGINT, signal.default_int_handler)

    ours = threading.current_thread() is threading.main_thread()
    if not (ours and signal.getsignal(signal.SIGINT) is signal.default_int_handler):
        yield interrupts
        return
    signal.signal(signal.SIGINT, note)
    try:
        yield interrupts
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
