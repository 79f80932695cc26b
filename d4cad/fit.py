"""A fitted program and what can be done with it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from math import log10, sqrt
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from d4cad import exporters, io
from d4cad.canvas import Canvas
from d4cad.descent import Record, Stop
from d4cad.errors import ExportError, GeometryError, InputError
from d4cad.exporters import preview
from d4cad.exporters.svg import svg
from d4cad.outputs import check_output
from d4cad.placement import DEFAULT_DPI, DEFAULT_THICKNESS, Placement
from d4cad.program import Floats, Program
from d4cad.protocols import Composed, Grammar
from d4cad.registry import entry
from d4cad.relations import Relation
from d4cad.sketch import Sketch
from d4cad.snapping import Snap

JOINING = (1e-4, 0.1)
"""Least and largest tolerance in pixels within which neighbouring edges are joined."""
OF_BODIES = (".step", ".stp", ".brep", ".dxf", ".svg")
"""Files that can hold bodies that lap over each other, each by itself."""
LEEWAY = 3.0
"""That tolerance as a multiple of the root mean square distance by which the fit misses the picture's boundary."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted program and how it was found.

    psnr: dB of its coverage against the target. outline: its exact outline in world units, neighbours on one line or
    circle joined. seconds, wall: CPU and elapsed seconds of the optimisation. settings: what was asked for, as JSON
    values. made: size and origin that the picture or the program file states. target: (height, width) coverage, row 0
    lowest; None if the fit came from a program file. start_psnr, start_primitives: of the program that the search began
    with. snap: what regularisation has done, None if it was not asked for. bodies: what STEP, BREP, DXF and SVG files
    hold in place of the outline, in world units.
    """

    program: Program[Any]
    canvas: Canvas
    grammar: Grammar[Any]
    psnr: float
    outline: Sketch
    history: tuple[Record, ...]
    stop: Stop
    seconds: float
    wall: float
    settings: Mapping[str, Any]
    made: Placement = field(default_factory=Placement)
    target: Floats | None = None
    start_psnr: float = 0.0
    start_primitives: int = 0
    snap: Snap | None = None
    bodies: Sketch | None = None

    @property
    def relations(self) -> tuple[Relation, ...]:
        """What holds exactly between the edges of `outline`; its named sizes are ``outline.dimensions``."""
        return self.outline.relations

    @property
    def counted(self) -> str | None:
        """What the grammar counts, such as "rectangle"; None where the outline's edges count."""
        return entry(self.language).counted

    @property
    def language(self) -> str:
        """The name by which the grammar was asked for: its own, or MODULE:OBJECT."""
        return str(self.settings.get("grammar", self.grammar.name))

    @property
    def primitives(self) -> int:
        """Number of what the grammar counts, or else of lines and arcs of the outline, a full circle counting two."""
        return self.outline.primitives if self.counted is None else self.grammar.primitives(self.program)

    @property
    def coverage(self) -> Floats:
        """Coverage of the program on its canvas, (height, width), row 0 lowest."""
        return self.grammar.rasterize(self.program, self.canvas).coverage

    def placement(
        self,
        width: float | None = None,
        scale: float | None = None,
        dpi: float | None = None,
        origin: str | None = None,
        thickness: float | None = None,
    ) -> Placement:
        """What is given, and for the rest what the picture or the program file states."""
        origin = self.made.origin if origin is None else origin
        thickness = self.made.thickness if thickness is None else thickness
        given = Placement(width, scale, dpi, origin, thickness, self.made.zero)
        if given.sized:
            return given
        return replace(given, width=self.made.width, scale=self.made.scale, dpi=self.made.dpi)

    def sketch(
        self,
        width: float | None = None,
        scale: float | None = None,
        dpi: float | None = None,
        origin: str | None = None,
    ) -> Sketch:
        """The part's outline in mm, y up.

        At most one of width: the part's extent in x, in mm; scale: mm per pixel; dpi: pixels per inch. Without one the
        picture's own resolution counts, or 96 dpi. origin: as :class:`d4cad.placement.Placement` has it.
        """
        return self.placement(width, scale, dpi, origin).place(self.outline, self.canvas)

    def rectangles(
        self,
        width: float | None = None,
        scale: float | None = None,
        dpi: float | None = None,
        origin: str | None = None,
    ) -> tuple[Sketch, ...]:
        """The rectangles whose union the part is, each as a sketch in mm at its place in the part; they lap over each
        other. Size and origin as for :meth:`sketch`.

        Raises InputError for a grammar without rectangles.
        """
        placement = self.placement(width, scale, dpi, origin)
        return tuple(placement.place(self.outline, self.canvas, piece) for piece in self.world_rectangles())

    def world_rectangles(self) -> tuple[Sketch, ...]:
        """The same in world units."""
        if not isinstance(self.grammar, Composed):
            raise InputError(f"a program in the grammar {self.grammar.name} is not a union of rectangles")
        return self.grammar.rectangles(self.program)

    def notes(self, placement: Placement, *, solid: bool) -> tuple[str, ...]:
        """What was assumed for a part so placed, a sentence each; ``solid``: whether a thickness matters."""
        found = [str(note) for note in self.settings.get("notes", ())]
        if not placement.sized:
            found.append(f"the picture states no resolution and no size was given: {DEFAULT_DPI:g} dpi assumed")
        if solid and placement.thickness is None:
            found.append(f"no thickness was given: {DEFAULT_THICKNESS:g} mm assumed")
        return tuple(found)

    def save(
        self,
        path: str | PathLike[str],
        *,
        thickness: float | None = None,
        width: float | None = None,
        scale: float | None = None,
        dpi: float | None = None,
        origin: str | None = None,
        **options: Any,
    ) -> None:
        """Write what the extension says: .json the program file, .step .stp .brep .stl .3mf .glb a solid of
        ``thickness`` mm, .py .scad its source code, .dxf .svg a drawing of the outline, .png a preview, .html a
        report.

        Size and origin as for :meth:`sketch`. options: name, color, kerf, form and all else in
        :class:`exporters.Options`, as far as the format takes them. Raises InputError for a bad value, ExportError if
        the file cannot be written; nothing is left behind then.
        """
        self.write(Path(path), self.placement(width, scale, dpi, origin, thickness), exporters.Options(**options))

    def write(self, path: Path, placement: Placement, options: exporters.Options | None = None) -> None:
        """As :meth:`save`, with the placement given as one value."""
        check_output(path, has_picture=self.target is not None, options=options)
        suffix = path.suffix.lower()
        if suffix == ".png":
            self.write_preview(path)
            return
        if suffix == ".html":
            from d4cad.reporting import write_page

            write_page(self, path, placement)
            return
        sketch = placement.place(self.outline, self.canvas)
        if suffix == ".json":
            io.write(path, self.document(sketch, placement))
        else:
            thickness = placement.thickness or DEFAULT_THICKNESS
            given = {} if options is None else options.given
            if suffix in exporters.SOURCES:  # code tells its reader where it comes from
                given.setdefault("name", str(self.settings.get("picture") or path.stem))
            drawn = placement.place(self.outline, self.canvas, self.bodies) if suffix in OF_BODIES else sketch
            exporters.write(drawn, path, thickness=thickness, **given)

    def write_preview(self, path: str | PathLike[str]) -> None:
        """Write target, outline with vertices, and error as .png or .svg. Raises ExportError."""
        if self.target is None:
            raise ExportError(f"cannot write {path}: a preview needs the picture, and a program file has none")
        count = f"{self.primitives} {self.counted or 'primitive'}s"
        title = f"{self.settings.get('picture', 'picture')}: {count}, {self.psnr:.1f} dB"
        preview.write_preview(Path(path), self.outline, self.canvas, self.target, self.coverage, title)

    def document(
        self, sketch: Sketch | None = None, placement: Placement | None = None, extra: Mapping[str, Any] | None = None
    ) -> io.ProgramFile:
        """The program file's contents: its loops those of ``sketch``, by default the outline in world units."""
        place = (
            {} if placement is None else {key: value for key, value in asdict(placement).items() if value is not None}
        )
        loops = self.outline if sketch is None else sketch
        return io.ProgramFile(
            grammar=self.language,
            structure=self.grammar.encode(self.program.structure),
            params=tuple(self.program.params.tolist()),
            canvas=self.canvas,
            settings={**self.settings, "placement": place},
            history=tuple(asdict(record) for record in self.history),
            stop=self.stop.name.lower(),
            psnr=self.psnr,
            primitives=self.primitives,
            unit=loops.unit,
            loops=loops.to_neutral(),
            relations=loops.relations,
            dimensions=loops.dimensions,
            extra={"cpu_s": self.seconds, "wall_s": self.wall, **(extra or {})},
        )

    @property
    def wrapped(self) -> Any:
        """The outline's faces in mm as one TopoDS shape, which CAD viewers show; raises as `Sketch.wrapped` does."""
        return self.sketch().wrapped

    def _repr_svg_(self) -> str:
        return svg(self.sketch())


def joined_outline(grammar: Grammar[Any], program: Program[Any], canvas: Canvas, error: float) -> Sketch:
    """The program's outline in world units, with neighbours on one line or circle made one edge.

    error: mean squared error of the coverage. An edge may move by a few times what the fit is off already: d pixels
    off change the coverage of a boundary pixel by d / (2 ramp), or by d where it is area.
    """
    coverage = grammar.rasterize(program, canvas).coverage
    band = max(int(np.count_nonzero((coverage > 0) & (coverage < 1))), 1)
    off = LEEWAY * 2 * (canvas.ramp or 0.5) * sqrt(error * canvas.size / band)
    low, high = JOINING
    outline, tolerance = grammar.outline(program), min(max(off, low), high)
    while tolerance >= low:
        joined = outline.simplified(tolerance * canvas.pixel)
        with suppress(GeometryError):  # where two parts of the outline are nearer to each other than the tolerance
            return Sketch.from_loops(joined.loops, joined.unit)
        tolerance /= 10
    return outline


def decibels(error: float) -> float:
    """Peak signal-to-noise ratio of a mean squared error, at most 300 dB."""
    return -10 * log10(max(error, 1e-30))
