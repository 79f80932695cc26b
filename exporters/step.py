"""STEP files: one solid per island, planes and cylinders only."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from d4cad.errors import ExportError
from d4cad.exporters.form import PLAIN, Form
from d4cad.exporters.occ import compound, kernel_errors
from d4cad.exporters.solids import solids_of
from d4cad.files import replacing
from d4cad.sketch import Sketch

TIMESTAMP = "2000-01-01T00:00:00"
"""Written in place of the time of day, so that the same part is the same file."""

SCHEMAS = {"AP214": "AP214IS", "AP242": "AP242DIS"}


def write_step(
    sketch: Sketch,
    path: str | Path,
    *,
    thickness: float,
    name: str = "part",
    schema: str = "AP214",
    form: Form = PLAIN,
) -> None:
    """Writes the sketch (mm), extruded from z = 0 to ``thickness`` mm, as a STEP file whose bytes are reproducible.

    ``form``: what else than extruded. ``name``: the product's. ``schema``: AP214, or AP242. Raises InputError for a bad
    thickness or unit, or a form that does not fit, ExportError if the kernel is missing or fails, or the file cannot
    be written.
    """
    if schema not in SCHEMAS:
        raise ExportError(f"unknown STEP schema {schema!r}: known are {', '.join(SCHEMAS)}")
    shape = compound(solids_of(sketch, thickness, form))
    text = _settled(_text(shape, schema), name)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="ascii")


def _text(shape: Any, schema: str) -> str:
    """The STEP file of a shape, with every number to its last digit: the kernel's own writing keeps twelve."""
    control, status = import_module("OCP.STEPControl"), import_module("OCP.IFSelect")
    writer = control.STEPControl_Writer()  # first: it defines the settings
    with _settings(SCHEMAS[schema]), _quiet(), kernel_errors():
        model = writer.Model(True)  # a new model, so that the schema applies to it
        done = writer.Transfer(shape, control.STEPControl_StepModelType.STEPControl_AsIs)
        if done != status.IFSelect_ReturnStatus.IFSelect_RetDone:
            raise ExportError("the CAD kernel could not turn the part into STEP entities")
        lines = import_module("OCP.StepData").StepData_StepWriter(model)
        lines.FloatWriter().SetFormat("%.16E")
        lines.SendModel(model.Protocol())
        return "".join(lines.Line(i).ToCString() + "\n" for i in range(1, lines.NbLines() + 1))


@contextmanager
def _settings(schema: str) -> Iterator[None]:
    """The kernel's global settings as we need them, put back afterwards for the user's own exports."""
    static = import_module("OCP.Interface").Interface_Static
    # one product for all islands; no parametric curves: planes and cylinders need none, and the file is a third
    wanted = {
        "write.step.schema": schema,
        "write.step.unit": "MM",
        "write.step.assembly": "0",
        "write.surfacecurve.mode": "0",
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
