"""The example of a grammar of one's own: what docs/grammar-authoring.md says of it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from d4cad.canvas import Canvas
from d4cad.program import Program
from d4cad.registry import make_grammar

NAME = "superellipse_grammar"
EXAMPLE = Path(__file__).parent.parent / "examples" / f"{NAME}.py"
SCRIPT = f"{EXAMPLE}:ENTRY"
CANVAS = Canvas.square(48)


def test_the_example_finds_both_superellipses_and_their_exponents() -> None:
    grammar: Any = sys.modules[type(make_grammar(SCRIPT, "fast", CANVAS)).__module__]
    fit = grammar.main()
    assert sorted(fit.program.structure) == [2, 8]
    assert fit.psnr > 80
    assert len(EXAMPLE.read_text(encoding="utf-8").splitlines()) < 150
    # a union of known curves: the outline's area is that of the coverage
    assert fit.outline.area == pytest.approx(fit.coverage.sum() * fit.canvas.pixel**2, rel=2e-3)


def test_the_example_s_derivatives() -> None:
    grammar: Any = make_grammar(SCRIPT, "fast", CANVAS)
    program = Program((4, 2), np.array([-0.2, 0.0, 0.8, 0.5, 0.3, 0.7, 0.3, 0.4, 0.3, -0.3]))
    weight = np.random.default_rng(0).standard_normal(CANVAS.shape)
    band = grammar.rasterize(program, CANVAS)
    assert np.array_equal(band.coverage, np.clip(band.coverage, 0, 1))
    found, h = band.pull_back(weight), 1e-7
    for i in range(program.params.size):
        step = np.where(np.arange(program.params.size) == i, h, 0)
        ends = [grammar.rasterize(program.moved(program.params + s * step), CANVAS).coverage for s in (1, -1)]
        assert found[i] == pytest.approx(float((weight * (ends[0] - ends[1])).sum()) / (2 * h), rel=1e-3, abs=1e-3)
