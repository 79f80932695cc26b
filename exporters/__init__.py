"""Ways from a Sketch to CAD files: a table of writers by extension."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from d4cad.errors import ExportError
from d4cad.exporters.brep import write_brep
from d4cad.exporters.form import PLAIN, Form
from d4cad.exporters.occ import require_kernel, require_thickness
from d4cad.exporters.step import write_step
from d4cad.exporters.stl import CHORD_TOLERANCE, write_stl
from d4cad.exporters.svg import write_svg
from d4cad.files import check_writable
from d4cad.sketch import Sketch

__all__ = ["CHORD_TOLERANCE", "EXTENSIONS", "Form", "check", "write"]


@dataclass(frozen=True, slots=True)
class Options:
    """What the writers may need. ``thickness``, ``tolerance``: mm. ``name``: the product's. ``form``: of a solid."""

    thickness: float
    name: str
    tolerance: float
    form: Form = PLAIN


@dataclass(frozen=True, slots=True)
class Writer:
    """One kind of file. ``solid``: it needs a thickness. ``kernel``: it needs OpenCASCADE."""

    write: Callable[[Sketch, Path, Options], None]
    solid: bool = True
    kernel: bool = False


def _step(sketch: Sketch, path: Path, options: Options) -> None:
    write_step(sketch, path, thickness=options.thickness, name=options.name, form=options.form)


def _brep(sketch: Sketch, path: Path, options: Options) -> None:
    write_brep(sketch, path, thickness=options.thickness, form=options.form)


def _stl(sketch: Sketch, path: Path, options: Options) -> None:
    write_stl(sketch, path, thickness=options.thickness, tolerance=options.tolerance, form=options.form)


def _svg(sketch: Sketch, path: Path, _: Options) -> None:
    write_svg(sketch, path)


WRITERS = {
    ".step": Writer(_step, kernel=True),
    ".stp": Writer(_step, kernel=True),
    ".brep": Writer(_brep, kernel=True),
    ".stl": Writer(_stl),
    ".svg": Writer(_svg, solid=False),
}

EXTENSIONS = tuple(WRITERS)
"""The extensions that :func:`write` knows."""


def write(
    sketch: Sketch,
    path: str | Path,
    *,
    thickness: float | None = None,
    name: str | None = None,
    tolerance: float = CHORD_TOLERANCE,
    form: Form = PLAIN,
) -> None:
    """Writes a sketch (mm) to ``path`` as its extension says; the file appears whole or not at all.

    ``thickness``: mm, for solids. ``name``: of the STEP product, the file's stem by default. ``tolerance``: mm,
    of the facets of a mesh. ``form``: how a solid is made, by default extruded. Raises ExportError for an unknown
    extension, a missing or failing CAD kernel and an unwritable file, InputError for a bad thickness,
    tolerance or unit, or a form that does not fit.
    """
    path = Path(path)
    writer = _writer(path)
    _require_solid(path, writer, form)
    height = require_thickness(thickness) if writer.solid else 0.0
    writer.write(sketch, path, Options(height, path.stem if name is None else name, tolerance, form))


def check(path: str | Path, *, thickness: float | None = None, form: Form = PLAIN) -> None:
    """Raises at once what :func:`write` would raise for these after a long fit; writes nothing."""
    path = Path(path)
    writer = _writer(path)
    _require_solid(path, writer, form)
    if writer.solid:
        require_thickness(thickness)
    if writer.kernel:
        require_kernel()
    check_writable(path)


def _require_solid(path: Path, writer: Writer, form: Form) -> None:
    if form != PLAIN and not writer.solid:
        raise ExportError(f"cannot write {path} with {' and '.join(form.names)}: a drawing has the plain outline only")


def _writer(path: Path) -> Writer:
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        given = path.suffix or "no extension"
        raise ExportError(f"cannot write {path}: known extensions are {' '.join(WRITERS)}, got {given}")
    return writer
