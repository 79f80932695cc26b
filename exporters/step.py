"""STEP files: one solid per island, planes and cylinders only."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from d4cad.errors import ExportError
from d4cad.exporters.color import Rgb, rgb
from d4cad.exporters.form import PLAIN, Form
from d4cad.exporters.occ import compound, is_valid, kernel_errors, volume
from d4cad.exporters.solids import EXACT, solids_of
from d4cad.files import replacing
from d4cad.sketch import Sketch

TIMESTAMP = "2000-01-01T00:00:00"
"""Written in place of the time of day, so that the same part is the same file."""

SCHEMAS = {"AP214": "AP214IS", "AP242": "AP242DIS"}


def require_schema(schema: str) -> str:
    """The schema. Raises ExportError unless it is one of SCHEMAS."""
    if schema not in SCHEMAS:
        raise ExportError(f"unknown STEP schema {schema!r}: known are {', '.join(SCHEMAS)}")
    return schema


def write_step(
    sketch: Sketch,
    path: str | Path,
    *,
    thickness: float,
    name: str = "part",
    schema: str = "AP214",
    color: str | None = None,
    form: Form = PLAIN,
) -> None:
    """Writes the sketch (mm), by default extruded up to ``thickness`` mm, as a STEP file whose bytes are reproducible.

    ``name``: the product's. ``schema``: AP214, or AP242. ``color``: of every solid, #rrggbb or a CSS name.
    ``form``: see :func:`d4cad.exporters.solids.solids_of`. Raises InputError for a bad thickness, unit or colour or a
    form that does not fit, ExportError if the kernel is missing or fails, or the file cannot be written.
    """
    require_schema(schema)
    shade = None if color is None else rgb(color)
    shape = compound(solids_of(sketch, thickness, form))
    turned = form.revolve is not None
    text = _settled(_text(shape, schema, curves=turned), name)
    if shade is not None:
        text = _colored(text, shade)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="ascii")
        if turned:
            _read_back(temporary, volume(shape))


def _read_back(path: Path, wanted: float) -> None:
    """Raises ExportError unless the file holds a valid shape of the volume: STEP is vague about surfaces that cross
    themselves, as an arc's does that is turned about a line through its circle."""
    done = import_module("OCP.IFSelect").IFSelect_ReturnStatus.IFSelect_RetDone
    with _quiet(), kernel_errors():
        reader = import_module("OCP.STEPControl").STEPControl_Reader()
        if reader.ReadFile(str(path)) == done and reader.TransferRoots():
            found = reader.OneShape()
            if is_valid(found) and abs(volume(found) - wanted) <= EXACT * wanted:
                return
    raise ExportError(
        "a STEP file cannot hold this profile turned by this angle: arcs from axis to axis need another vertex between,"
        " or a gap to the axis"
    )


def _text(shape: Any, schema: str, *, curves: bool) -> str:
    """The STEP file of a shape, with every number to its last digit: the kernel's own writing keeps twelve.

    curves: with the parametric curves of every edge, without which a reader has to find them on a surface that may
    cross itself. Planes and cylinders need none, and the file is a third.
    """
    control, status = import_module("OCP.STEPControl"), import_module("OCP.IFSelect")
    writer = control.STEPControl_Writer()  # first: it defines the settings
    with _settings(SCHEMAS[schema], "1" if curves else "0"), _quiet(), kernel_errors():
        model = writer.Model(True)  # a new model, so that the schema applies to it
        done = writer.Transfer(shape, control.STEPControl_StepModelType.STEPControl_AsIs)
        if done != status.IFSelect_ReturnStatus.IFSelect_RetDone:
            raise ExportError("the CAD kernel could not turn the part into STEP entities")
        lines = import_module("OCP.StepData").StepData_StepWriter(model)
        lines.FloatWriter().SetFormat("%.16E")
        lines.SendModel(model.Protocol())
        return "".join(lines.Line(i).ToCString() + "\n" for i in range(1, lines.NbLines() + 1))


@contextmanager
def _settings(schema: str, curves: str) -> Iterator[None]:
    """The kernel's global settings as we need them, put back afterwards for the user's own exports."""
    static = import_module("OCP.Interface").Interface_Static
    # one product for all islands
    wanted = {
        "write.step.schema": schema,
        "write.step.unit": "MM",
        "write.step.assembly": "0",
        "write.surfacecurve.mode": curves,
    }
    before = {key: static.CVal_s(key) for key in wanted}
    try:
        for key, value in wanted.items():
            static.SetCVal_s(key, value)
        yield
    finally:
        for key, value in before.items():
            static.SetCVal_s(key, value)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keeps the kernel from printing statistics on standard output."""
    message = import_module("OCP.Message")
    printers = list(message.Message.DefaultMessenger_s().Printers())
    before = [printer.GetTraceLevel() for printer in printers]
    try:
        for printer in printers:
            printer.SetTraceLevel(message.Message_Gravity.Message_Fail)
        yield
    finally:
        for printer, level in zip(printers, before, strict=True):
            printer.SetTraceLevel(level)


def _settled(text: str, name: str) -> str:
    """The file with our name, the shortest numbers, and neither time of day nor running number of products."""
    text = re.sub(r"\n\s+(?=,?-?\d)", "", text)  # broken for the longer numbers
    text = re.sub(r"-?\d\.\d{16}E[+-]\d+", lambda m: _shortest(float(m[0])), text)
    text = re.sub(r"(FILE_NAME\s*\(\s*'(?:[^']|'')*'\s*,\s*)'[^']*'", rf"\g<1>'{TIMESTAMP}'", text, count=1)
    text = re.sub(r"(FILE_NAME\s*\(\s*)'(?:[^']|'')*'", lambda m: f"{m[1]}'{encoded(name)}'", text, count=1)
    counter = r"(PRODUCT\s*\(\s*)'(?:[^']|'')*'\s*,\s*'(?:[^']|'')*'"
    return re.sub(counter, lambda m: f"{m[1]}'{encoded(name)}','{encoded(name)}'", text)


def _colored(text: str, color: Rgb) -> str:
    """The file with a surface colour for every solid.

    The entities are those of the CAx-IF recommended practices "Model styling and organization"
    (https://www.mbx-if.org/documents/rec_prac_styling_org_v16.pdf), in sRGB as OpenCASCADE reads and writes them.
    They are added here because the kernel's own writer of coloured documents brings its own idea of products.
    """
    bodies = re.findall(r"^#(\d+)\s*=\s*MANIFOLD_SOLID_BREP\b", text, re.MULTILINE)
    (context,) = re.findall(r"^#(\d+)\s*=\s*\(\s*GEOMETRIC_REPRESENTATION_CONTEXT\b", text, re.MULTILINE)
    n = max(int(number) for number in re.findall(r"^#(\d+)\s*=", text, re.MULTILINE))
    red, green, blue = (_shortest(value / 255) for value in color)
    styles = [
        f"COLOUR_RGB('',{red},{green},{blue})",
        f"FILL_AREA_STYLE_COLOUR('',#{n + 1})",
        f"FILL_AREA_STYLE('',(#{n + 2}))",
        f"SURFACE_STYLE_FILL_AREA(#{n + 3})",
        f"SURFACE_SIDE_STYLE('',(#{n + 4}))",
        f"SURFACE_STYLE_USAGE(.BOTH.,#{n + 5})",
        f"PRESENTATION_STYLE_ASSIGNMENT((#{n + 6}))",
        *(f"STYLED_ITEM('color',(#{n + 7}),#{body})" for body in bodies),
    ]
    items = ",".join(f"#{n + k}" for k in range(8, len(styles) + 1))
    styles.append(f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',({items}),#{context})")
    lines = "".join(f"#{n + k} = {style};\n" for k, style in enumerate(styles, 1))
    head, end, tail = text.rpartition("ENDSEC;")
    return head + lines + end + tail


def _shortest(value: float) -> str:
    """The shortest STEP real that reads back as the same number: 3., 0.25, 1.E-07."""
    mantissa, _, exponent = repr(value + 0.0).upper().partition("E")
    mantissa = mantissa.removesuffix("0") if mantissa.endswith(".0") else mantissa
    return f"{mantissa}{'' if '.' in mantissa else '.'}{'E' + exponent if exponent else ''}"


def encoded(text: str) -> str:
    r"""``text`` as the inside of a STEP string (ISO 10303-21): quotes doubled, other alphabets as \X2\ or \X4\ hex."""
    safe = text.replace("\\", "\\\\").replace("'", "''")
    return re.sub(r"[^\x20-\x7e]+", _hex, safe)


def _hex(found: re.Match[str]) -> str:
    wide = max(found[0]) > "\uffff"
    code = found[0].encode("utf-32-be" if wide else "utf-16-be", "replace").hex().upper()
    return f"\\X{4 if wide else 2}\\{code}\\X0\\"
