"""Solids of every form in OpenCASCADE, through OCP alone; each is measured against what geometry says it must hold."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from math import atan, isclose
from typing import Any

from d4cad.errors import ExportError
from d4cad.exporters.form import PLAIN, Form
from d4cad.exporters.occ import compound, explored, is_valid, kernel_errors, require_kernel, solids, volume
from d4cad.exporters.plan import Column, Rounding, Slab, plan, rim_name
from d4cad.exporters.revolve import revolved
from d4cad.sketch import Sketch

EXACT = 1e-6
"""Largest relative error of a volume: planes, cylinders and cones are exact up to the kernel's integration."""

ROUNDED = 0.1
"""The same for what a fillet takes away: the kernel rounds over kinks that are nearly tangent."""

LEVEL = 1e-6
"""mm within which a face is at the height of a rim."""


def solids_of(sketch: Sketch, thickness: float, form: Form = PLAIN) -> list[Any]:
    """Valid TopoDS_Solids of the sketch (mm) in a ``form``, by default extruded from z = 0 to ``thickness`` mm.

    A form that has its own size (base plate, revolution) does without the thickness. Raises InputError for a number out
    of range or a form that does not fit, ExportError if the kernel is missing or fails.
    """
    if form == PLAIN:
        return solids(sketch, thickness)
    require_kernel()
    if form.revolve is not None:
        return revolved(sketch, form.revolve)
    parts = plan(sketch, thickness, form)
    with kernel_errors():
        wanted = sum(column.volume for column in parts.add)
        found = _checked(_joined(parts.add), wanted, form)
        if parts.cut:
            wanted -= sum(column.volume for column in parts.cut)
            found = _checked(_cut(found, parts.cut), wanted, form)
        if parts.roundings:
            removed = sum(rounding.volume for rounding in parts.roundings)
            found = [_rounded(solid, parts.roundings) for solid in found]
            rest = sum(map(volume, found))
            if not (all(map(is_valid, found)) and abs(wanted - rest - removed) <= ROUNDED * removed):
                raise _refused(parts.roundings[0])
            wanted = rest
        if parts.hollow:
            wanted -= sum(column.volume for column in parts.hollow)
            found = _checked(_cut(found, parts.hollow), wanted, form)
    return found


def _checked(found: list[Any], wanted: float, form: Form) -> list[Any]:
    """The solids, if they are valid and have the volume that they must have."""
    found = [_mended(solid) for solid in found]
    made = sum(map(volume, found))
    if found and all(map(is_valid, found)) and abs(made - wanted) <= EXACT * wanted:
        return found
    wrong = "an invalid solid" if isclose(made, wanted, rel_tol=EXACT) else f"{made:.6g} mm^3 of {wanted:.6g} mm^3"
    raise ExportError(
        f"the CAD kernel failed at {' and '.join(form.names)} and made {wrong}: a slightly smaller size often works"
    )


def _joined(columns: Sequence[Column]) -> list[Any]:
    """All slabs of the columns, made one where they touch."""
    layers = [_slab(slab) for column in columns for slab in column.slabs]
    whole = compound(layers[0])
    for layer in layers[1:]:
        whole = _boolean("Fuse", whole, compound(layer))
    return explored(whole, "SOLID")


def _cut(found: list[Any], columns: Sequence[Column]) -> list[Any]:
    tools = [compound(_joined([column])) for column in columns]
    return explored(_boolean("Cut", compound(found), compound(tools)), "SOLID")


def _boolean(name: str, a: Any, b: Any) -> Any:
    maker = getattr(import_module("OCP.BRepAlgoAPI"), f"BRepAlgoAPI_{name}")(a, b)
    if not maker.IsDone():
        raise ExportError(f"the CAD kernel failed to {name.lower()} two bodies: a slightly smaller size often works")
    return maker.Shape()


def _slab(slab: Slab) -> list[Any]:
    """Its solids: extruded from z = 0, drafted there, and lifted."""
    gp, location = import_module("OCP.gp"), import_module("OCP.TopLoc").TopLoc_Location
    lift = gp.gp_Trsf()
    lift.SetTranslation(gp.gp_Vec(0.0, 0.0, slab.bottom))
    upright = solids(slab.sketch, slab.top - slab.bottom)
    hinge = slab.level - slab.bottom
    return [(_leaning(solid, slab.slope, hinge) if slab.slope else solid).Moved(location(lift)) for solid in upright]


def _leaning(solid: Any, slope: float, hinge: float) -> Any:
    """A prism on z = 0 whose walls are turned about their edges at z = ``hinge``."""
    gp = import_module("OCP.gp")
    up, neutral = gp.gp_Dir(0, 0, 1), gp.gp_Pln(gp.gp_Pnt(0, 0, hinge), gp.gp_Dir(0, 0, 1))
    maker = import_module("OCP.BRepOffsetAPI").BRepOffsetAPI_DraftAngle(solid)
    for face in explored(solid, "FACE"):
        if _level(face) is None:
            maker.Add(face, up, atan(slope), neutral)
            if not maker.AddDone():
                break
    else:
        maker.Build()
        if maker.IsDone():
            return _mended(maker.Shape())
    raise ExportError("the CAD kernel could not lean the walls of this outline: another draft or chamfer may work")


def _rounded(solid: Any, roundings: Sequence[Rounding]) -> Any:
    """All fillets at once: one after the other the kernel takes corners for new edges."""
    maker = import_module("OCP.BRepFilletAPI").BRepFilletAPI_MakeFillet(solid)
    for face in explored(solid, "FACE"):
        height = _level(face)
        for rounding in roundings:
            if height is not None and abs(height - rounding.level) <= LEVEL:
                for edge in explored(face, "EDGE"):
                    maker.Add(rounding.fillet.size, edge)
    try:
        with kernel_errors():
            maker.Build()
    except ExportError:
        raise _refused(roundings[0]) from None
    found = explored(maker.Shape(), "SOLID") if maker.IsDone() else []
    if len(found) != 1:
        raise _refused(roundings[0])
    return _mended(found[0])


def _mended(shape: Any) -> Any:
    """The solid; if it is invalid, with the tolerances that its curves really have.

    Walls that are nearly tangent meet along a curve that the kernel knows to 1e-6 mm and states as 1e-7 mm.
    """
    if not is_valid(shape):
        mender = import_module("OCP.ShapeFix").ShapeFix_Shape(shape)
        mender.Perform()
        shape = mender.Shape()
    return explored(shape, "SOLID")[0]


def _refused(rounding: Rounding) -> ExportError:
    return ExportError(
        f"the CAD kernel could not make {rim_name(rounding.fillet)} along this outline:"
        " a smaller one or a chamfer may work, or an outline whose tangent edges are exactly so"
    )


def _level(face: Any) -> float | None:
    """The height of a horizontal face, None for a wall."""
    surface = import_module("OCP.BRepAdaptor").BRepAdaptor_Surface(face)
    if surface.GetType() != import_module("OCP.GeomAbs").GeomAbs_SurfaceType.GeomAbs_Plane:
        return None
    plane = surface.Plane()
    upright = abs(plane.Axis().Direction().Z()) > 1 - 1e-9
    return float(plane.Location().Z()) if upright else None
