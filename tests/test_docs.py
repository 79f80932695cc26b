"""What README and docs say can be done is done here: their commands run, their snippets run, their site builds.

A block that cannot run has a line before it that says why: `<!-- not run: needs a cluster -->`. A command with a word
in capitals (DATA_DIR) needs files that are not shipped, and only its options are checked.
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from html.parser import HTMLParser
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from itertools import pairwise
from pathlib import Path
from typing import Any

import click
import ezdxf
import pytest
import typer
from PIL import Image, ImageDraw
from typer.testing import CliRunner

from d4cad.beams.design import design_beam
from d4cad.cli import app

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
BLOCK = re.compile(
    r"^(?P<mark><!-- not run: [^\n]*-->\n)?(?P<fence>```)(?P<language>\w*)\n(?P<text>.*?)^```$", re.M | re.S
)
INDENTED = re.compile(r"^    (d4cad [^\n]*)$", re.M)
INLINE = re.compile(r"`(d4cad [a-z]+[^`]*|python [a-z]+/[^`]*|make [a-z]+)`")
PLACEHOLDER = re.compile(r"\b[A-Z][A-Z_]+\b")
NEITHER = ("make", "pip", "python", "#", "$")
"""How lines begin that are commands, but are not run: they install things or take minutes."""
FAILURES = {"check": (0, 1)}
"""Exit codes that mean that a command did its work, if not 0 alone."""


@dataclass(frozen=True, slots=True)
class Block:
    """Fenced text of a page, the number of its first line, and whether a line before it says that it cannot run."""

    page: Path
    line: int
    language: str
    text: str
    excused: bool

    @property
    def name(self) -> str:
        """As pytest shows it."""
        return f"{self.page.name}:{self.line}"


def blocks() -> Iterator[Block]:
    """All blocks of all pages."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for found in BLOCK.finditer(text):
            line = text[: found.start("text")].count("\n") + 1
            yield Block(page, line, found["language"], found["text"], found["mark"] is not None)


def commands() -> list[tuple[str, str]]:
    """(where, command) of every `d4cad` command that stands on a line of its own."""
    found = []
    for block in blocks():
        if block.excused or block.language not in ("", "sh", "bash", "console"):
            continue
        for k, line in enumerate(block.text.splitlines()):
            line = line.removeprefix("$ ")
            if line.startswith("d4cad "):
                found.append((f"{block.page.name}:{block.line + k}", line))
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        outside = BLOCK.sub(lambda match: "\n" * match[0].count("\n"), text)
        for match in INDENTED.finditer(outside):
            found.append((f"{page.name}:{text[: match.start()].count(chr(10)) + 1}", match[1]))
    return found


def words(command: str) -> list[str]:
    """A command's words, comments left out."""
    return shlex.split(command, comments=True)[1:]


@pytest.fixture(scope="session")
def things(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the pages speak of."""
    folder = tmp_path_factory.mktemp("things")
    pictures = ROOT / "examples" / "pictures"
    shutil.copy(pictures / "bracket.png", folder)
    shutil.copytree(pictures, folder / "examples" / "pictures", ignore=shutil.ignore_patterns("g*", "*.py"))
    (folder / "pics").mkdir()
    shutil.copy(pictures / "letter.png", folder / "pics")
    logo = Image.new("RGB", (240, 160), "white")
    for box, color in (
        ((20, 20, 110, 140), "#c02020"),
        ((130, 30, 220, 80), "#2040c0"),
        ((130, 100, 220, 130), "#108040"),
    ):
        ImageDraw.Draw(logo).rounded_rectangle(box, 12, fill=color)
    logo.save(folder / "logo.png")
    done = CliRunner().invoke(
        app, ["fit", str(folder / "bracket.png"), "--width", "80", "-o", str(folder / "part.json")]
    )
    assert done.exit_code == 0, done.output
    shutil.copy(folder / "part.json", folder / "plate.json")
    bracket, source = str(folder / "bracket.json"), str(folder / "bracket.py")
    for command in (
        ["fit", str(folder / "bracket.png"), "--width", "79.2", "-o", bracket],
        ["export", bracket, "-o", source, "--dialect", "cadquery"],
    ):
        assert CliRunner().invoke(app, command).exit_code == 0
    hole = ["fit", str(pictures / "letter.png"), "--width", "8", "-o", str(folder / "hole.json")]
    assert CliRunner().invoke(app, hole).exit_code == 0
    drawing(folder / "slot.dxf", [(0, 0), (40, 0), (40, 6), (0, 6)])
    (folder / "messy.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="60mm" height="40mm" viewBox="0 0 60 40">'
        f'<path d="M{" L".join(f"{x / 10} {40 - (x / 150) ** 2}" for x in range(601))} L60 40 L0 40Z"/></svg>'
    )
    problem = next(block for block in blocks() if block.page.name == "beams.md" and block.language == "toml")
    (folder / "bracket.toml").write_text(problem.text)
    return folder


def drawing(path: Path, points: list[tuple[float, float]]) -> None:
    """A DXF file with one closed polygon, in mm."""
    document = ezdxf.new(units=ezdxf.units.MM)
    document.modelspace().add_lwpolyline(points, close=True)
    document.saveas(path)


@pytest.fixture
def desk(things: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A fresh copy of them, in which one stands."""
    shutil.copytree(things, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(arguments: list[str]) -> list[Path]:
    """Files that a command is told to write."""
    flags = ("-o", "--output", "--preview", "--picture", "--report")
    return [Path(b) for a, b in pairwise(arguments) if a in flags and Path(b).stem[:1] != "."]


@pytest.mark.parametrize(
    "command", [pytest.param(c, id=w) for w, c in commands() if not PLACEHOLDER.search(" ".join(words(c)))]
)
def test_commands_of_the_pages_run(command: str, desk: Path) -> None:
    arguments = words(command)
    if arguments[0] == "beam":
        arguments += ["--max-time", "0.3", "--element", "2"]  # any part will do
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code in FAILURES.get(arguments[0], (0,)), done.output
    if "--out-dir" not in arguments and arguments[0] != "tables":
        for path in written(arguments):
            numbered = path.with_name(f"{path.stem}-1{path.suffix}")  # of the first layer
            assert path.exists() or numbered.exists(), f"{command} wrote no {path}"


SNIPPETS = [pytest.param(b, id=b.name) for b in blocks() if b.language == "python" and not b.excused]


@pytest.mark.parametrize("block", SNIPPETS)
def test_snippets_of_the_pages_run(block: Block, desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = compile(block.text, block.name, "exec")
    monkeypatch.setattr("d4cad.beams.design.design_beam", partial(design_beam, max_time=0.3))  # any part will do
    for library in ("build123d", "cadquery"):
        if library in block.text and find_spec(library) is None:
            pytest.skip(f"the snippet shows {library}, which is not installed")
    before = set(desk.rglob("*"))
    names: dict[str, Any] = {"__name__": "snippet"}
    exec(code, names)
    assert len(names) > 2 or set(desk.rglob("*")) - before


def named() -> list[tuple[str, str]]:
    """(where, command) of every command within a sentence, and of those that cannot run for want of files."""
    found = [(where, command) for where, command in commands() if PLACEHOLDER.search(command)]
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for match in INLINE.finditer(BLOCK.sub(lambda block: "\n" * block[0].count("\n"), text)):
            found.append((f"{page.name}: {match[1]}", match[1]))
    return found


@pytest.mark.parametrize("command", [pytest.param(c, id=w) for w, c in named()])
def test_commands_within_sentences_exist(command: str) -> None:
    program, first, *rest = shlex.split(command, comments=True)
    if program == "make":
        assert re.search(rf"^{first}:", (ROOT / "Makefile").read_text(), re.M)
    elif program == "python":
        assert (ROOT / first).is_file()
        source = (ROOT / first).read_text()
        for word in rest:
            if word.startswith("--"):
                assert f'"{word}"' in source, f"{first} has no {word}"
    else:
        group: Any = typer.main.get_command(app)
        made = group.get_command(click.Context(group), first)
        assert made is not None, f"there is no command {first}"
        known = {name for option in made.params for name in (*option.opts, *option.secondary_opts)}
        assert {word for word in rest if word.startswith("-") and not word[1:2].isdigit()} <= known


def test_what_is_not_run_says_why() -> None:
    for block in blocks():
        if block.language == "python" and block.excused:
            before = block.page.read_text(encoding="utf-8").splitlines()[block.line - 3]
            assert re.fullmatch(r"<!-- not run: \w[^>]{5,} -->", before)
        for line in block.text.splitlines() if block.language in ("", "sh", "bash") and not block.excused else []:
            program = line.removeprefix("$ ").split(" ")[0]
            if program in ("d4cad", *NEITHER):
                continue
            assert not re.match(r"[a-z0-9]+ -", line.lstrip()), f"{block.name} has a command of unknown kind: {line}"


def test_the_gallery_is_whole() -> None:
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    cards = re.findall(r'<img src="([^"]+)" alt="([^"]+)"', text)
    assert len(cards) >= 24
    for path, alt in cards:
        assert (DOCS / path).is_file()
        assert "dB" in alt


def loaded(name: str) -> Any:
    """A script of docs/ as a module."""
    spec = spec_from_file_location(f"docs_{name}", DOCS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_the_gallery_is_drawn_by_its_script(tmp_path: Path) -> None:
    found = loaded("gallery").main(tmp_path, limit=1)
    assert found["results"] == 1
    assert found["worst"] > 60
    now, kept = ((folder / "images" / "gallery" / "01.svg").read_text() for folder in (tmp_path, DOCS))
    for mark in ("<path", "<circle", "<image"):
        assert now.count(mark) == kept.count(mark) > 0


def test_the_figures_are_drawn_by_their_script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    figures = loaded("figures")
    monkeypatch.setattr(figures, "OUT", tmp_path)
    for draw in (figures.draw_rewrites, figures.draw_ramps):
        draw()
    for name in ("rewrites", "ramps"):
        assert (tmp_path / f"{name}.svg").stat().st_size > 5000
    text = (DOCS / "how-it-works.md").read_text(encoding="utf-8")
    for path in re.findall(r"\]\((images/[^)]+)\)", text):
        assert (DOCS / path).is_file()


class Links(HTMLParser):
    """What a page links to, and what it loads by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loads: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note a tag's address."""
        values = dict(attrs)
        if tag == "a" and values.get("href"):
            self.links.append(str(values["href"]))
        address = values.get("src") or (values.get("href") if tag == "link" else None)
        if address:
            self.loads.append(str(address))


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site. Whoever builds it has no network: sockets refuse to be made."""
    for module in ("mkdocs", "material", "mkdocstrings_handlers.python"):
        if find_spec(module.split(".")[0]) is None:
            pytest.skip(f"needs {module}: pip install 'd4cad[docs]'")
    out = tmp_path_factory.mktemp("site")
    code = (
        "import socket, sys\n"
        "def refuse(*args, **kwargs): raise OSError('no network')\n"
        "socket.socket.connect = refuse; socket.getaddrinfo = refuse\n"
        "from mkdocs.__main__ import cli; cli()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "build", "--strict", "--quiet", "-f", ROOT / "mkdocs.yml", "-d", out],
        capture_output=True, text=True, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def test_the_site_is_whole_and_loads_nothing_from_elsewhere(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert {page.stem for page in pages} >= {page.stem for page in DOCS.glob("*.md")}
    for page in pages:
        links = Links()
        links.feed(page.read_text(encoding="utf-8"))
        for address in links.loads:
            assert not address.startswith(("http:", "https:", "//")), f"{page.name} loads {address}"
        for address in (*links.links, *links.loads) if page.name != "404.html" else ():
            path = address.split("#")[0].split("?")[0]
            if path and not re.match(r"[a-z]+:", path):
                target = (page.parent / path).resolve()
                assert target.exists(), f"{page.name} links to {address}"


def test_the_site_shows_the_library(site: Path) -> None:
    text = (site / "api.html").read_text(encoding="utf-8")
    for name in ("d4cad.fitting.fit_image", "d4cad.sketch.Sketch", "d4cad.exporters.build123d.ProgramSketch"):
        assert f'id="{name}"' in text
    assert ":class:" not in text
    assert ":func:" not in text
