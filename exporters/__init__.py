"""Ways from a Sketch to CAD files: a table of writers by extension."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from d4cad.errors import ExportError, InputError
from d4cad.exporters.brep import write_brep
from d4cad.exporters.color import rgb
from d4cad.exporters.dxf import write_dxf
from d4cad.exporters.form import PLAIN, Form
from d4cad.exporters.glb import write_glb
from d4cad.exporters.kerf import require_kerf
from d4cad.exporters.mesh import CHORD_TOLERANCE, require_tolerance
from d4cad.exporters.occ import require_kernel, require_thickness
from d4cad.exporters.source import require_dialect, write_python, write_scad
from d4cad.exporters.step import require_schema, write_step
from d4cad.exporters.stl import write_stl
from d4cad.exporters.svg import require_style, write_svg
from d4cad.exporters.threemf import write_3mf
from d4cad.files import check_writable
from d4cad.sketch import Sketch

__all__ = ["CHORD_TOLERANCE", "EXTENSIONS", "SOURCES", "Form", "Options", "check", "heeded", "takers", "write"]


@dataclass(frozen=True, slots=True)
class Options:
    """What a file may be given beyond its outline; None: not given, nor is a plain form.

    name: of the part. schema: of STEP, AP214 or AP242. color: #rrggbb or a CSS name. tolerance: mm, of a mesh's facets
    from the exact walls. kerf: mm that a cutter takes away, for drawings. style: of SVG, fill or cut. dialect: of
    source code in Python, build123d, build123d-algebra or cadquery. form: of solids, beyond the plain extrude.
    Raises InputError, or ExportError for the schema, where a value cannot be used.
    """

    name: str | None = None
    schema: str | None = None
    color: str | None = None
    tolerance: float | None = None
    kerf: float | None = None
    style: str | None = None
    dialect: str | None = None
    form: Form | None = None

    def __post_init__(self) -> None:
        if self.schema is not None:
            require_schema(self.schema)
        if self.color is not None:
            rgb(self.color)
        if self.tolerance is not None:
            require_tolerance(self.tolerance)
        if self.kerf is not None:
            require_kerf(self.kerf)
        if self.style is not None:
            require_style(self.style)
        if self.dialect is not None:
            require_dialect(self.dialect, python=True)

    @property
    def given(self) -> dict[str, Any]:
        """The options that are given, by name."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {name: value for name, value in values.items() if value is not None and value != PLAIN}


Write = Callable[..., None]
"""Called with a sketch, a path, and as keywords the options given, a solid's ``thickness`` and a ``name`` it takes."""


@dataclass(frozen=True, slots=True)
class Writer:
    """One kind of file. ``takes``: its options. ``solid``: it has a thickness. ``kernel``: it needs OpenCASCADE."""

    write: Write
    takes: frozenset[str] = frozenset()
    solid: bool = True
    kernel: bool = False


def _takes(names: str) -> frozenset[str]:
    return frozenset(names.split())


_STEP = Writer(write_step, _takes("name schema color form"), kernel=True)

WRITERS = {
    ".step": _STEP,
    ".stp": _STEP,
    ".brep": Writer(write_brep, _takes("form"), kernel=True),
    ".stl": Writer(write_stl, _takes("tolerance form")),
    ".3mf": Writer(write_3mf, _takes("name color tolerance form")),
    ".glb": Writer(write_glb, _takes("name color tolerance form")),
    ".py": Writer(write_python, _takes("name dialect")),
    ".scad": Writer(write_scad, _takes("name tolerance")),
    ".dxf": Writer(write_dxf, _takes("kerf"), solid=False),
    ".svg": Writer(write_svg, _takes("name color kerf style"), solid=False),
}

EXTENSIONS = tuple(WRITERS)
"""The extensions that :func:`write` knows."""
SOURCES = (".py", ".scad")
"""Those of source code."""


def write(
    sketch: Sketch,
    path: str | Path,
    *,
    thickness: float | None = None,
    name: str | None = None,
    schema: str | None = None,
    color: str | None = None,
    tolerance: float | None = None,
    kerf: float | None = None,
    style: str | None = None,
    dialect: str | None = None,
    form: Form | None = None,
) -> None:
    """Writes a sketch (mm) to ``path`` as its extension says; the file appears whole or not at all.

    ``thickness``: mm, for solids; drawings have none. ``name``: of the part, the file's stem by default. ``schema``:
    of STEP, AP214 (default) or AP242. ``color``: #rrggbb or a CSS name. ``tolerance``: mm, of the facets of a mesh,
    CHORD_TOLERANCE by default. ``kerf``: mm that a cutter takes away, see :func:`d4cad.exporters.kerf.compensated`.
    ``style``: of SVG, "fill" (default) or "cut". ``dialect``: of a .py file, build123d (default), build123d-algebra or
    cadquery. ``form``: how a solid is made, by default extruded.
    Raises ExportError for an unknown extension or schema, a missing or failing CAD kernel and an unwritable file,
    InputError for a bad value or unit and for an option that the format cannot hold.
    """
    path = Path(path)
    options = Options(name, schema, color, tolerance, kerf, style, dialect, form)
    writer = _checked(path, options)
    keywords = options.given
    if "name" in writer.takes:
        keywords.setdefault("name", path.stem)
    if writer.solid:
        keywords["thickness"] = require_thickness(thickness)
    writer.write(sketch, path, **keywords)


def check(path: str | Path, *, thickness: float | None = None, options: Options | None = None) -> None:
    """Raises at once what :func:`write` would raise for these after a long fit; writes nothing."""
    path = Path(path)
    writer = _checked(path, options or Options())
    if writer.solid:
        require_thickness(thickness)
    if writer.kernel:
        require_kernel()
    check_writable(path)


def heeded(path: str | Path, options: Options) -> Options:
    """Those of the options that the format of ``path`` can hold, for one set of options and files of several kinds."""
    writer = WRITERS.get(Path(path).suffix.lower())
    takes = frozenset() if writer is None else writer.takes
    return replace(options, **{name: None for name in options.given if name not in takes})


def takers(option: str) -> str:
    """The extensions of the formats that can hold an option."""
    return " ".join(extension for extension, writer in WRITERS.items() if option in writer.takes)


def _checked(path: Path, options: Options) -> Writer:
    """The writer for ``path``. Raises where there is none, or it cannot heed an option."""
    suffix = path.suffix.lower()
    writer = WRITERS.get(suffix)
    if writer is None:
        given = path.suffix or "no extension"
        raise ExportError(f"cannot write {path}: known extensions are {' '.join(WRITERS)}, got {given}")
    for name in options.given:
        if name not in writer.takes:
            raise InputError(f"cannot write {path}: a {suffix} file takes no {name}, only {takers(name)} files do")
    return writer
