"""Files that appear whole or not at all, and texts whose absence is told in a sentence."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from d4cad.errors import ExportError, InputError


def read_text(path: Path, what: str) -> str:
    """The text of a file that should be a ``what``, such as "program file". Raises InputError, which names ``path``."""
    if path.is_dir():
        raise InputError(f"expected a {what}, but {path} is a folder")
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(f"there is no {what} {path}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path} is not a {what}: it is not text") from None
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error


def check_writable(path: str | Path) -> None:
    """Raises ExportError, one sentence, if a file at ``path`` clearly cannot be written; leaves nothing behind."""
    with _claimed(Path(path)):
        pass


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary name in the folder of ``path``, with its extension, that becomes ``path`` when the block ends.

    Write to it by name. When the block raises (KeyboardInterrupt included) it is removed and what was at ``path``
    stays. Raises ExportError where the system refuses to write.
    """
    path = Path(path)
    with _claimed(path) as temporary:
        try:
            yield temporary
            target = path.resolve()
            if target.exists():
                shutil.copymode(target, temporary)
            os.replace(temporary, target)
        except OSError as error:
            raise _refusal(path, error.strerror or str(error)) from error


@contextmanager
def _claimed(path: Path) -> Iterator[Path]:
    """Creates an empty temporary file beside the target of ``path``, and removes it if it is still there."""
    target = path.resolve()
    if target.exists() and not target.is_file():
        raise _refusal(path, "it is a folder" if target.is_dir() else "it is not a regular file")
    if target.exists() and not os.access(target, os.W_OK):
        raise _refusal(path, "it is read-only")
    temporary = target.with_name(f".{target.stem[:80]}-{secrets.token_hex(4)}{target.suffix}")
    try:
        temporary.touch(exist_ok=False)
    except OSError as error:
        raise _refusal(path, error.strerror or str(error)) from error
    try:
        yield temporary
    finally:
        temporary.unlink(missing_ok=True)


def _refusal(path: Path, reason: str) -> ExportError:
    return ExportError(f"cannot write {path}: {reason}")
