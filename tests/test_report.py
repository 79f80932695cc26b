"""The figures of fidelity, and the page that shows them."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from d4cad.bench import coverage
from d4cad.canvas import Canvas
from d4cad.cli import app
from d4cad.errors import ExportError, InputError
from d4cad.fidelity import apart, contour, measured, samples
from d4cad.fit import Fit
from d4cad.fitting import fit_image
from d4cad.programs import load_program
from d4cad.reporting import fidelity, write_page
from d4cad.sketch import Circle, Sketch

N = 96
CANVAS = Canvas.square(N, 0.5)


def disc(radius: float) -> Sketch:
    """A disc of a radius in pixels in the middle."""
    return Sketch.from_loops([Circle((0, 0), radius * CANVAS.pixel).loop()])


@pytest.fixture(scope="module")
def fit() -> Fit:
    return fit_image(np.round(255 * (1 - coverage(disc(30), CANVAS)[::-1])).astype(np.uint8))


def test_the_contour_of_a_ramp_is_where_it_is_one_half() -> None:
    target = np.clip((np.arange(20) - 7.25)[None, :] / 4, 0, 1).repeat(16, axis=0)
    edge = contour(target)
    left = samples(edge).real.min()
    assert left == pytest.approx(9.25 + 0.5)  # 1/2 lies at index 9.25, and a pixel's centre half a pixel in
    assert samples(edge).real.max() == pytest.approx(20.0)  # the ground beyond closes it


def test_distances_of_two_circles() -> None:
    target = coverage(disc(30), CANVAS)
    figures, trace = measured(target, coverage(disc(31), CANVAS), disc(31), CANVAS, 0.5, 30.0)
    assert figures.largest_px == pytest.approx(1.0, abs=0.1)
    assert figures.mean_px == pytest.approx(1.0, abs=0.03)
    assert figures.redrawn_px == pytest.approx(1.0, abs=0.1)
    assert figures.largest_mm == pytest.approx(0.5 * figures.largest_px)
    assert figures.iou == pytest.approx(30**2 / 31**2, abs=1e-3)
    assert figures.narrowest_px == pytest.approx(62, abs=0.5)
    assert np.abs(trace.points) / CANVAS.pixel == pytest.approx(31.0)
    assert trace.apart.max() <= figures.largest_px
    perfect, _ = measured(target, target, disc(30), CANVAS, 1.0, 120.0)
    assert perfect.largest_px < 0.1  # a contour between pixel centres is that far off a curve
    assert perfect.redrawn_px < 1e-9


def test_distances_are_those_to_all_edges() -> None:
    rng = np.random.default_rng(0)
    edge = contour(coverage(disc(20), CANVAS))
    q = rng.uniform(0, N, 200) + 1j * rng.uniform(0, N, 200)
    near = np.array([min(abs(q[k] - z) for z in samples(edge, 0.001)) for k in range(20)])
    np.testing.assert_allclose(apart(q, edge)[:20], near, atol=2e-3)


def test_features_under_the_tolerance_are_warned_of() -> None:
    thin = Sketch.from_loops([Circle((0, 0), 30 * CANVAS.pixel).loop(), Circle((0, 0), 29.3 * CANVAS.pixel).loop()])
    target = coverage(thin, CANVAS)
    figures, _ = measured(target, target, thin, CANVAS, 2.0, 99.0)
    (warning,) = figures.warnings
    assert warning == "the narrowest wall or gap is 0.7 px (1.4 mm), under 1 px, which the picture can hardly show"
    figures, _ = measured(target, target, thin, CANVAS, 2.0, 99.0, 4.0)
    assert figures.warnings[0] == "the narrowest wall or gap is 0.7 px (1.4 mm), under 4 px, the tolerance"
    with pytest.raises(InputError, match="no edge"):
        measured(np.zeros((N, N)), target, thin, CANVAS, 1.0, 0.0)


class Page(HTMLParser):
    """Tags that are open, those that load something, and the cells of tables."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loads: list[str] = []
        self.rows: list[list[str]] = []
        self.seen: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.add(tag)
        self.loads += [str(value) for name, value in attrs if name in ("src", "href", "xlink:href")]
        if tag not in ("meta", "link", "br"):
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.loads += [str(value) for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "td":
            self.rows[-1].append(data)


def test_the_page_is_whole_and_loads_nothing(fit: Fit, tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    write_page(fit, path, relations=[("concentric", "loop 1 & <loop 2>")])
    page = Page()
    text = path.read_text()
    page.feed(text)
    assert page.open == []
    assert "script" not in page.seen
    assert page.loads
    assert all(link.startswith(("data:image/png;base64,", "#")) for link in page.loads)
    assert not re.search(r"url\((?!#)", text)
    assert len(re.findall("<figure>", text)) == 3
    assert 'name="viewport"' in text
    rows = [row for row in page.rows if row and row[0].isdigit()]
    part = fit.sketch()
    assert len(rows) == sum(1 if loop.circle is not None else len(loop.points) for loop in part.loops)
    assert sum(float(row[-1]) for row in rows) == pytest.approx(part.length, abs=1e-3)
    assert ["concentric", "loop 1 & <loop 2>"] in page.rows
    again = tmp_path / "again.html"
    write_page(fit, again, relations=[("concentric", "loop 1 & <loop 2>")])
    assert again.read_bytes() == path.read_bytes()


def test_the_course_of_the_search_can_be_read(fit: Fit, tmp_path: Path) -> None:
    first = next(record for record in fit.history if record.loss < np.inf)
    steps = [replace(first, step=k, loss=10 ** -(2.369 + 0.0002 * k)) for k in range(3)]
    write_page(replace(fit, history=tuple(steps)), tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text()
    assert ">23.692</text>" in text  # the axis names values, not what to add to another
    (label,) = re.findall(r'x="([0-9.]+)"[^>]*>PSNR, dB</text>', text)
    assert float(label) > 10  # the height of its letters: it is not cut off


def test_report_on_the_command_line(fit: Fit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert fit.target is not None
    Image.fromarray(np.round(255 * (1 - fit.target[::-1])).astype(np.uint8)).save("disc.png")
    done = CliRunner().invoke(
        app, ["fit", "disc.png", "--report", "r.html", "-o", "p.json", "--scale", "0.1", "--json"]
    )
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert facts["files"] == ["p.json", "r.html"]
    assert facts["fidelity"]["largest_px"] < 0.1
    assert facts["fidelity"]["largest_mm"] == pytest.approx(0.1 * facts["fidelity"]["largest_px"])
    assert "px (" in Path("r.html").read_text()
    fit.save("s.html", scale=0.1)
    assert Path("s.html").read_text().startswith("<!DOCTYPE html>")
    with pytest.raises(ExportError, match="a report needs the picture"):
        load_program("p.json").save("t.html")
    with pytest.raises(ExportError, match="a report needs the picture"):
        fidelity(load_program("p.json"))
    refused = CliRunner().invoke(app, ["fit", "disc.png", "--report", "r.pdf"])
    assert refused.exit_code == 2
    assert "a report is .html" in refused.stderr
