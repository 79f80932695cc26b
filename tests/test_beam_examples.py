"""The examples run and their parts are what they promise; on coarse grids, so that they are fast."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from d4cad.beams.connection import require_supported
from d4cad.beams.reading import parse_problem
from d4cad.beams.writing import toml_of
from d4cad.programs import load_program

EXAMPLES = Path(__file__).parent.parent / "examples"


def example(name: str) -> Any:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_documented_problem_is_one() -> None:
    """Every key of docs/beams.md, with its unit, is read."""
    page = (EXAMPLES.parent / "docs" / "beams.md").read_text()
    text = page.split("```toml\n")[1].split("```")[0]
    problem = parse_problem(text)
    require_supported(problem)
    assert parse_problem(toml_of(problem)) == problem
    assert problem.material.strength == 240
    assert len(problem.cuts) == len(problem.voids) == len(problem.solids) == 1


def test_cantilever(tmp_path: Path) -> None:
    facts = example("cantilever_to_step").main(tmp_path, element=3.0)
    assert facts["primitives"] <= 40
    assert facts["volume"] == pytest.approx(0.4, abs=0.015)
    assert facts["compliance_fine"] < 1.1 * 72.73  # the best known, on a grid of a ninth as many elements
    assert (tmp_path / "cantilever.step").stat().st_size > 1000
    assert load_program(tmp_path / "cantilever.json").primitives == facts["primitives"]


def test_l_bracket(tmp_path: Path) -> None:
    facts = example("l_bracket_with_bolts").main(tmp_path, element=2.0)
    assert facts["safety_factor"] == pytest.approx(240 / facts["max_von_mises_mpa"])
    part = load_program(tmp_path / "l_bracket.json").sketch()
    circles = [loop.circle for loop in part.loops if loop.circle is not None]
    for centre in ((12, 88), (28, 88), (90, 30)):
        assert any(
            np.hypot(circle.center[0] - centre[0], circle.center[1] - centre[1]) < 1e-3
            and circle.radius == pytest.approx(4, abs=1e-3)
            for circle in circles
        ), f"no bolt hole at {centre}"
    assert (tmp_path / "l_bracket.png").exists()


def test_mbb_of_rectangles(tmp_path: Path) -> None:
    """Lines alone; two mirrored halves; the bars are those that the picture shows."""
    facts = example("mbb_of_rectangles").main(tmp_path, element=4.0)
    assert facts["arcs"] == facts["circles"] == 0
    assert facts["volume"] == pytest.approx(0.5, abs=1e-3)
    assert facts["compliance_fine"] < 1.2 * 85.03  # the best known, on a grid of a sixteenth as many elements
    lengths, widths, angles = np.array(facts["bars"]).T
    assert 4 <= len(lengths) <= 30
    assert np.all(widths <= lengths)
    assert np.all((angles >= 0) & (angles < 180))
    assert lengths.max() > 60
    part = load_program(tmp_path / "mbb.json").sketch()
    z = np.array([complex(*point) for loop in part.loops for point in loop.points])
    mirrored = 360 - z.real + 1j * z.imag
    assert np.abs(z[:, None] - mirrored).min(axis=1).max() < 1e-6
