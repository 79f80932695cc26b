"""OpenCASCADE's own BREP files."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from d4cad.errors import ExportError
from d4cad.exporters.form import PLAIN, Form
from d4cad.exporters.occ import compound
from d4cad.exporters.solids import solids_of
from d4cad.files import replacing
from d4cad.sketch import Sketch


def write_brep(sketch: Sketch, path: str | Path, *, thickness: float, form: Form = PLAIN) -> None:
    """Writes the sketch (mm), extruded from z = 0 to ``thickness`` mm. Raises as :func:`write_step` does."""
    shape = compound(solids_of(sketch, thickness, form))
    with replacing(path) as temporary:
        if not import_module("OCP.BRepTools").BRepTools.Write_s(shape, str(temporary)):
            raise ExportError("the CAD kernel could not write the BREP file")
