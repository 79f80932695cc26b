"""Files that a fit can be saved as, by extension, and the checks that come before a long fit."""

from __future__ import annotations

from pathlib import Path

from d4cad import exporters
from d4cad.errors import ExportError, InputError
from d4cad.exporters.form import Form
from d4cad.files import check_writable
from d4cad.placement import DEFAULT_THICKNESS

OWN = (".json", ".png", ".html")
"""Those that say more than the outline: the program, a preview, a report."""
EXTENSIONS = (*OWN, *exporters.EXTENSIONS)
SOLIDS = tuple(extension for extension, writer in exporters.WRITERS.items() if writer.solid)


def check_output(path: Path, *, has_picture: bool, options: exporters.Options | None = None) -> None:
    """Raises ExportError, one sentence, if a fit clearly cannot be saved at ``path``; leaves nothing behind.

    has_picture: whether there is a target, without which there is no preview. options: InputError if ``path`` is of a
    kind that cannot heed them.
    """
    suffix = path.suffix.lower()
    if suffix not in EXTENSIONS:
        raise ExportError(f"cannot write {path}: known extensions are {' '.join(EXTENSIONS)}, got {suffix or 'none'}")
    if suffix in (".png", ".html") and not has_picture:
        kind = "preview" if suffix == ".png" else "report"
        raise ExportError(f"cannot write {path}: a {kind} needs the picture, and a program file has none")
    if suffix not in OWN:
        exporters.check(path, thickness=DEFAULT_THICKNESS, options=options)
        return
    if options is not None and options.given:
        raise InputError(f"cannot write {path}: a {suffix} file takes no {' or '.join(options.given)}")
    check_writable(path)


def has_thickness(path: Path, form: Form) -> bool:
    """Whether the part's thickness has a say in a file of this kind, of this form if it takes one."""
    suffix = path.suffix.lower()
    return suffix in SOLIDS and (form.needs_thickness or "form" not in exporters.WRITERS[suffix].takes)
