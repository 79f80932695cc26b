"""What the exporters to CAD libraries take: a sketch, a fit or a program file; what they say without the library."""

from __future__ import annotations

from os import PathLike, fspath
from typing import Protocol

from d4cad import io
from d4cad.errors import ExportError, GeometryError, InputError
from d4cad.exporters.occ import broken
from d4cad.sketch import Sketch


class Sketched(Protocol):
    """What can give its outline in mm, as `d4cad.Fit` can."""

    def sketch(self) -> Sketch:
        """The outline, in mm."""
        ...


Part = Sketch | Sketched | str | PathLike[str]


def sketch_of(part: Part) -> Sketch:
    """The sketch of a part: itself, what its method ``sketch`` gives, or the outline that a program file states.

    Raises InputError, which names the file, where that is no program file, states no size or bounds no region.
    """
    if isinstance(part, Sketch):
        return part
    if isinstance(part, (str, PathLike)):
        return _outline(part)
    return part.sketch()


def _outline(path: str | PathLike[str]) -> Sketch:
    file = io.read(path)
    if file.unit != "mm":
        raise InputError(f"{fspath(path)} states no size: use d4cad.load_program(path).sketch(width=...) instead")
    try:
        return Sketch.from_neutral(file.loops, file.unit)
    except GeometryError as error:
        raise InputError(f"{fspath(path)} is not a usable program file: {error}") from None


def unusable(library: str, error: ImportError) -> ExportError:
    """One sentence for a library, "build123d" or "cadquery", that does not import, and how to mend it."""
    if isinstance(error, ModuleNotFoundError) and error.name == library:
        return ExportError(f"d4cad.exporters.{library} needs {library}: pip install 'd4cad[{library}]'")
    return broken(library, error)
