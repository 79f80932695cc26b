"""Designed parts as files: CAD, and the program file that holds the outline as an Arc-Line program with its problem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from d4cad import exporters, io
from d4cad.beams.design import Beam
from d4cad.beams.writing import toml_of
from d4cad.errors import ExportError
from d4cad.files import check_writable
from d4cad.fit import Fit
from d4cad.importers import Drawing
from d4cad.programs import from_drawing

EXTENSIONS = (".json", *exporters.EXTENSIONS)


def check_output(path: Path, thickness: float) -> None:
    """Raises ExportError, one sentence, if a beam clearly cannot be saved at ``path``; leaves nothing behind."""
    suffix = path.suffix.lower()
    if suffix not in EXTENSIONS:
        raise ExportError(f"cannot write {path}: known extensions are {' '.join(EXTENSIONS)}, got {suffix or 'none'}")
    if suffix == ".json":
        check_writable(path)
    else:
        exporters.check(path, thickness=thickness)


def save(beam: Beam, path: Path, settings: Mapping[str, Any] | None = None) -> None:
    """Writes what the extension says: .json the program file, else the part by that exporter. Raises ExportError.

    settings: what was asked for, as JSON values; kept in the program file.
    """
    check_output(path, beam.problem.thickness)
    if path.suffix.lower() != ".json":
        exporters.write(beam.outline, path, thickness=beam.problem.thickness)
        return
    fit = as_fit(beam, settings or {})
    problem = {"problem": toml_of(beam.problem), "compliance": beam.compliance}
    io.write(path, fit.document(beam.outline, fit.placement(), problem))


def as_fit(beam: Beam, settings: Mapping[str, Any]) -> Fit:
    """The part's outline as a program that lies where the part lies in its domain, for all that takes a fit."""
    fit = from_drawing(Drawing(beam.outline, beam.primitives), beam.problem.name)
    return replace(
        fit,
        history=beam.history,
        stop=beam.stop,
        seconds=beam.seconds,
        settings={**fit.settings, "beam": dict(settings)},
        made=replace(fit.made, thickness=beam.problem.thickness),
    )
