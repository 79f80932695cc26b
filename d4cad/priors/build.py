"""Makes silhouettes.xz from a folder of SVG icons: `python -m d4cad.priors.build FOLDER`.

FOLDER is the unpacked npm package @phosphor-icons/core (MIT): ``npm pack @phosphor-icons/core`` fetches it. Only its
filled style is taken. Same input, same bytes.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import InputError
from d4cad.priors.library import SIDE, Library, packed

SUFFIX = "-fill.svg"
OVERSAMPLED = 4
"""Pixels along a pixel of a silhouette when it is drawn; half of them inside make it one of the shape."""
VIEW = 256.0
"""Side of Phosphor's view box."""

LEFT_OUT = re.compile(r"-logo|^lego|^finn-the-human$|^article-ny-times$|^airplay$")
"""Names of marks and figures that belong to others."""

ENTRY = re.compile(r'name: "(?P<name>[a-z0-9-]+)".*?tags: \[(?P<tags>.*?)\]', re.DOTALL)


def drawn(paths: Sequence[str]) -> NDArray[np.bool_]:
    """The silhouette (SIDE, SIDE) of paths in Phosphor's view box, filled by the non-zero rule, row 0 lowest."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import PathPatch

    figure = Figure(figsize=(1, 1), dpi=SIDE * OVERSAMPLED)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(0, VIEW)
    axes.set_ylim(VIEW, 0)
    axes.axis("off")
    for path in paths:
        axes.add_patch(PathPatch(outline(path), facecolor="black", linewidth=0))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    ink = 255.0 - np.asarray(canvas.buffer_rgba())[::-1, :, 0]  # type: ignore[no-untyped-call]
    means = ink.reshape(SIDE, OVERSAMPLED, SIDE, OVERSAMPLED).mean(axis=(1, 3))
    return np.asarray(means > 127.5)


def outline(data: str) -> Any:
    """The matplotlib path of an SVG path."""
    from matplotlib.path import Path as Outline
    from svgelements import Close, CubicBezier, Line, Move, QuadraticBezier
    from svgelements import Path as Drawn

    path = Drawn(data)
    path.approximate_arcs_with_cubics()
    codes: dict[Any, tuple[list[Any], tuple[str, ...]]] = {
        Move: ([Outline.MOVETO], ("end",)),
        Line: ([Outline.LINETO], ("end",)),
        CubicBezier: ([Outline.CURVE4] * 3, ("control1", "control2", "end")),
        QuadraticBezier: ([Outline.CURVE3] * 2, ("control", "end")),
    }
    points: list[tuple[float, float]] = []
    kinds: list[int] = []
    for segment in path:
        if isinstance(segment, Close):
            points.append(points[-1])
            kinds.append(int(Outline.CLOSEPOLY))
            continue
        kind, ends = codes[type(segment)]
        kinds += kind
        points += [(getattr(segment, end).x, getattr(segment, end).y) for end in ends]
    return Outline(points, kinds)


def built(folder: Path) -> Library:
    """The library of an unpacked package. Raises InputError if the folder is not one."""
    index, icons = folder / "dist" / "index.mjs", folder / "assets" / "fill"
    if not index.is_file() or not icons.is_dir():
        raise InputError(f"expected the unpacked package @phosphor-icons/core in {folder}")
    tags = {
        entry["name"]: tuple(tag for tag in re.findall(r'"([^"]+)"', entry["tags"]) if not tag.startswith("*"))
        for entry in ENTRY.finditer(index.read_text())
    }
    names, pictures = [], []
    files = sorted(icons.glob(f"*{SUFFIX}"))
    for file in [file for file in files if not LEFT_OUT.search(file.name.removesuffix(SUFFIX))]:
        names.append(file.name.removesuffix(SUFFIX))
        pictures.append(drawn(re.findall(r'<path d="([^"]+)"', file.read_text())))
    return Library(tuple(names), tuple(tags.get(name, ()) for name in names), np.array(pictures))


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--output", type=Path, default=Path(__file__).parent / "silhouettes.xz")
    asked = parser.parse_args()
    library = built(asked.folder)
    asked.output.write_bytes(packed(library))


if __name__ == "__main__":
    main()
