"""GLB, binary glTF 2.0: for web pages, renderers and viewers."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from d4cad.exporters.color import linear
from d4cad.exporters.form import PLAIN, Form
from d4cad.exporters.mesh import CHORD_TOLERANCE, mesh
from d4cad.exporters.names import printable
from d4cad.files import replacing
from d4cad.sketch import Sketch

GREY = "#b4bac2"
"""The colour of a part for which none was given: without a material viewers take white, mirror-bright metal."""


def write_glb(
    sketch: Sketch,
    path: str | Path,
    *,
    thickness: float,
    tolerance: float = CHORD_TOLERANCE,
    name: str = "part",
    color: str | None = None,
    form: Form = PLAIN,
) -> None:
    """Writes the sketch (mm), by default extruded from z = 0, as a binary glTF file whose bytes are reproducible.

    glTF is in metres with y up: (x, y, z) mm here is (x, z, -y) / 1000 there, so that the part lies on the ground and
    its top faces up. ``name``: the node's and mesh's. ``color``: #rrggbb or a CSS name. Raises as
    :func:`d4cad.exporters.mesh.mesh` does, and InputError for an unknown colour.
    """
    light = [*linear(GREY if color is None else color), 1.0]
    vertices, triangles = mesh(sketch, thickness, tolerance, form)
    x, y, z = vertices.T / 1000
    trimesh = import_module("trimesh")
    body = trimesh.Trimesh(np.stack([x, z, -y], axis=1), triangles, process=False)
    body.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial())
    label = printable(name) or "part"
    scene = trimesh.Scene()
    scene.add_geometry(body, node_name=label, geom_name=label)

    def shade(tree: dict[str, Any]) -> None:
        # here because trimesh rounds colours to 8 bits, too coarse for dark ones in linear light
        surface = {"baseColorFactor": light, "metallicFactor": 0.0, "roughnessFactor": 0.6}
        tree["materials"] = [{"name": label, "pbrMetallicRoughness": surface}]

    data = trimesh.exchange.gltf.export_glb(scene, include_normals=False, tree_postprocessor=shade)
    with replacing(path) as temporary:
        temporary.write_bytes(data)
