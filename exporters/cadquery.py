"""CadQuery sketches of exact faces. The methods for `Workplane` are in `d4cad.cadquery`.

>>> import cadquery as cq  # doctest: +SKIP
>>> cq.Workplane().placeSketch(to_cadquery("bracket.json")).extrude(6)  # doctest: +SKIP

Importing this module imports CadQuery, which takes a second; without it, it raises ExportError.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from d4cad.exporters.occ import faces
from d4cad.exporters.parts import Part, sketch_of, unusable

try:
    from cadquery import Compound, Face, Sketch, Workplane
except ImportError as error:
    raise unusable("cadquery", error) from error

__all__ = ["attach", "to_cadquery"]


def to_cadquery(part: Part) -> Sketch:
    """A CadQuery Sketch of a sketch (mm), a fit or a program file: its faces in the plane z = 0, normals +z.

    Raises InputError for a sketch that is empty or not in mm, ExportError where the kernel fails.
    """
    return Sketch(obj=Compound.makeCompound([Face(face) for face in faces(sketch_of(part))]))


def attach(*methods: Callable[..., Any]) -> None:
    """Makes functions of a workplane methods of CadQuery's `Workplane`, under their own names."""
    for method in methods:
        setattr(Workplane, method.__name__, method)
