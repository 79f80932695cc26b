"""Draws docs/images/solids.png, one picture of each form: `python docs/images/solids.py`."""

from __future__ import annotations

from math import pi, radians, tan
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray
from PIL import Image
from trimesh.remesh import subdivide_to_size

from d4cad.exporters.form import Chamfer, Emboss, Engrave, Fillet, Form, Pocket, Revolve, Shell
from d4cad.exporters.form_mesh import form_mesh
from d4cad.sketch import Circle, Loop, Sketch

LIGHT = np.array([0.35, -0.5, 0.8]) / np.linalg.norm([0.35, -0.5, 0.8])
STEEL = np.array([0.42, 0.58, 0.74])


def bracket() -> Sketch:
    """30 x 20 mm, rounded, with a bore and a slot."""
    q = tan(pi / 8)
    corners = ((4, 0), (26, 0), (30, 4), (30, 16), (26, 20), (4, 20), (0, 16), (0, 4))
    slot = Loop(((19, 6), (23, 6), (23, 14), (19, 14)), (1.0, 0.0, 1.0, 0.0)).oriented()
    return Sketch.from_loops([Loop(corners, (0, q) * 4), Circle((9, 10), 4.5).loop(), slot], "mm")


def goblet() -> Sketch:
    """A half profile, 20 mm high, with a round wall."""
    points = ((0, 0), (8, 0), (8, 2), (2, 4), (2, 9), (9, 20), (8, 20), (0, 11))
    return Sketch.from_loops([Loop(points, (0, 0, -0.3, 0, 0.35, 0, -0.3, 0))], "mm")


FORMS: dict[str, tuple[Sketch, float, Form]] = {
    "plain": (bracket(), 6, Form()),
    "pocket": (bracket(), 6, Form([Pocket(2.5, 1)])),
    "draft": (bracket(), 6, Form(draft=radians(12))),
    "fillet": (bracket(), 6, Form(rim=Fillet(1.5))),
    "chamfer": (bracket(), 6, Form(rim=Chamfer(1.5, "both"))),
    "shell": (bracket(), 6, Form(shell=Shell(1.0))),
    "emboss": (bracket(), 2, Form(relief=Emboss(2.5, margin=2))),
    "engrave": (bracket(), 5, Form(relief=Engrave(2.5, margin=2))),
    "revolve": (goblet(), 1, Form(revolve=Revolve(radians(270)))),
    "pocket, draft, chamfer": (bracket(), 6, Form([Pocket(2.5, 1)], draft=radians(5), rim=Chamfer(1.0))),
}


def shaded(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> Poly3DCollection:
    """Facets lit from the front left; small ones, because they are drawn whole and from back to front."""
    vertices, triangles = subdivide_to_size(vertices, triangles, max_edge=0.9, max_iter=20)
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    bright = 0.45 + 0.55 * np.clip(normals @ LIGHT, 0, 1)
    colours = np.c_[np.clip(STEEL * bright[:, None] * 1.25, 0, 1), np.ones(len(bright))]
    return Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.2)


def main() -> None:
    """Writes the picture."""
    figure = plt.figure(figsize=(10, 4.2), dpi=90)
    for k, (name, (sketch, thickness, form)) in enumerate(FORMS.items()):
        axes = figure.add_subplot(2, 5, k + 1, projection="3d", proj_type="ortho")
        vertices, triangles = form_mesh(sketch, thickness, 0.02, form)
        axes.add_collection3d(shaded(vertices, triangles))
        middle, half = (vertices.min(axis=0) + vertices.max(axis=0)) / 2, 17.0
        axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half))
        axes.set(zlim=(middle[2] - half, middle[2] + half))
        axes.set_box_aspect((1, 1, 1), zoom=1.5)
        axes.view_init(elev=38, azim=-62)
        axes.set_axis_off()
        axes.set_title(name, fontsize=10, y=0.92)
    figure.subplots_adjust(0, 0, 1, 0.96, 0, 0)
    figure.canvas.draw()
    picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[:, :, :3].copy())
    picture.quantize(48, dither=Image.Dither.NONE).save(Path(__file__).with_suffix(".png"), optimize=True)
    plt.close(figure)


if __name__ == "__main__":
    main()
