"""build123d sketches: exact faces, as a value or as an object for its builders.

>>> from build123d import BuildPart, BuildSketch, GridLocations, extrude  # doctest: +SKIP
>>> with BuildPart() as plates:  # doctest: +SKIP
...     with BuildSketch(), GridLocations(100, 80, 2, 3):
...         ProgramSketch("bracket.json")
...     extrude(amount=6)

Importing this module imports build123d, which takes a second; without it, it raises ExportError.
"""

from __future__ import annotations

from d4cad.exporters.occ import faces
from d4cad.exporters.parts import Part, sketch_of, unusable

try:
    from build123d import Align, BaseSketchObject, BuildSketch, Face, Mode, Sketch, validate_inputs
except ImportError as error:
    raise unusable("build123d", error) from error

__all__ = ["ProgramSketch", "to_build123d"]


def to_build123d(part: Part) -> Sketch:
    """A build123d Sketch of a sketch (mm), a fit or a program file: its faces in the plane z = 0, normals +z.

    Raises InputError for a sketch that is empty or not in mm, ExportError where the kernel fails.
    """
    return Sketch([Face(face) for face in faces(sketch_of(part))])


class ProgramSketch(BaseSketchObject):  # type: ignore[misc]  # build123d's types are not followed
    """Sketch object: the outline of a sketch (mm), a fit or a program file.

    As build123d's own, it works within `BuildSketch`, at `Locations`, and in algebra mode. ``rotation``: degrees,
    counter-clockwise. ``align``: MIN, CENTER or MAX of its bounding box at the origin; None keeps the sketch's own
    origin. ``mode``: how it is combined. Raises as :func:`to_build123d`.
    """

    _applies_to = [BuildSketch._tag]  # noqa: RUF012  (the name and type that build123d looks for)

    def __init__(
        self,
        part: Part,
        rotation: float = 0,
        align: Align | tuple[Align, Align] | None = None,
        mode: Mode = Mode.ADD,
    ) -> None:
        validate_inputs(BuildSketch._get_context(self), self)
        super().__init__(to_build123d(part), rotation, align, mode)
