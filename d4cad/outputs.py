"""Files that a fit can be saved as, by extension, and the checks that come before a long fit."""

from __future__ import annotations

from pathlib import Path

from d4cad import exporters
from d4cad.errors import ExportError
from d4cad.exporters.form import PLAIN, Form
from d4cad.files import check_writable
from d4cad.placement import DEFAULT_THICKNESS

EXTENSIONS = (".json", ".png", *exporters.EXTENSIONS)
SOLIDS = tuple(extension for extension, writer in exporters.WRITERS.items() if writer.solid)


def check_output(path: Path, *, has_picture: bool, form: Form = PLAIN) -> None:
    """Raises ExportError, one sentence, if a fit clearly cannot be saved at ``path``; leaves nothing behind.

    has_picture: whether there is a target, without which there is no preview. form: of the solids.
    """
    suffix = path.suffix.lower()
    if suffix not in EXTENSIONS:
        raise ExportError(f"cannot write {path}: known extensions are {' '.join(EXTENSIONS)}, got {suffix or 'none'}")
    if suffix == ".png" and not has_picture:
        raise ExportError(f"cannot write {path}: a preview needs the picture, and a program file has none")
    if suffix in (".json", ".png") and form != PLAIN:
        raise ExportError(f"cannot write {path} with {' and '.join(form.names)}: only solids have a form")
    if suffix in (".json", ".png"):
        check_writable(path)
    else:
        exporters.check(path, thickness=DEFAULT_THICKNESS, form=form)


def is_solid(path: Path) -> bool:
    """Whether a file of this kind has a thickness."""
    return path.suffix.lower() in SOLIDS
