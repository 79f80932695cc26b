"""Names for a sketch's sizes, as a designer would call them."""

from __future__ import annotations

from collections.abc import Iterator
from math import exp, pi

from d4cad.regularize.measures import Measures
from d4cad.regularize.parameters import Parameters
from d4cad.relations import Dimension, Ref
from d4cad.sketch import Sketch

SAME = 1e-9
"""Sizes whose relative difference is less are one."""
SEMICIRCLE = 1e-6


def named_dimensions(sketch: Sketch) -> tuple[Dimension, ...]:
    """The named sizes of a sketch: width and height, every radius and diameter, and what its relations fix.

    Edges of one use and one size share a name: ``hole_diameter`` of circular holes, ``disc_diameter`` of circular
    faces, ``corner_radius`` of arcs tangent to a line on either side, ``end_radius`` of semicircles, ``arc_radius`` of
    other arcs, ``length`` and ``distance`` of what was made round. Where a use has several sizes they are numbered
    from the largest: hole_diameter_1, hole_diameter_2.
    """
    if not sketch.faces:
        return ()
    layout = Parameters(sketch)
    at = Measures.of(layout, layout.values)
    xmin, ymin, xmax, ymax = sketch.bounds
    rounds = {(r.kind, ref): r.value for r in sketch.relations for ref in (r.refs or ((-1, -1),))}
    found = [
        Dimension("width", "width", (), rounds.get(("width", (-1, -1))) or xmax - xmin, ("width", (-1, -1)) in rounds),
        Dimension(
            "height", "height", (), rounds.get(("height", (-1, -1))) or ymax - ymin, ("height", (-1, -1)) in rounds
        ),
    ]
    uses: dict[tuple[str, str], list[tuple[float, list[Ref], bool]]] = {}
    for use, kind, value, refs, is_round in _sizes(sketch, layout, at):
        group = uses.setdefault((use, kind), [])
        same = next((entry for entry in group if abs(entry[0] - value) <= SAME * value), None)
        if same is None or kind == "distance":
            group.append((value, [*refs], is_round))
        else:
            same[1].extend(ref for ref in refs if ref not in same[1])
            if is_round and not same[2]:
                group[group.index(same)] = (value, same[1], True)
    for (use, kind), group in uses.items():
        group.sort(key=lambda entry: -entry[0])
        for k, (value, members, is_round) in enumerate(group, 1):
            name = use if len(group) == 1 else f"{use}_{k}"
            found.append(Dimension(name, kind, tuple(members), value, is_round))
    return tuple(found)


def _sizes(sketch: Sketch, layout: Parameters, at: Measures) -> Iterator[tuple[str, str, float, tuple[Ref, ...], bool]]:
    """use, kind, value, references and whether it was made round, of every size."""
    fixed = [r for r in sketch.relations if r.kind in ("radius", "diameter", "length", "distance", "angle")]
    tangent = {r.refs for r in sketch.relations if r.kind == "tangent"}
    for relation in fixed:
        assert relation.value is not None
        edges = [layout.number(ref) for ref in relation.refs]
        use = relation.kind
        if relation.kind in ("radius", "diameter"):
            use = _use(layout, at, edges[0], tangent)
        yield use, relation.kind, relation.value, relation.refs, relation.kind != "angle"
    loop = 0
    for face in sketch.faces:
        for k in range(len(face.loops)):
            start, size = layout.starts[loop], layout.sizes[loop]
            if layout.circles[loop]:
                use = "hole_diameter" if k else "disc_diameter"
                yield use, "diameter", 2 * _radius(at, start), (layout.refs[start],), False
            else:
                for edge in range(start, start + size):
                    if layout.arcs[edge]:
                        yield _use(layout, at, edge, tangent), "radius", _radius(at, edge), (layout.refs[edge],), False
            loop += 1


def _radius(at: Measures, edge: int) -> float:
    return exp(float(at.radius.value[edge]))


def _use(layout: Parameters, at: Measures, edge: int, tangent: set[tuple[Ref, ...]]) -> str:
    """What an arc or circle is there for."""
    loop = layout.refs[edge][0]
    if layout.circles[loop]:
        return "hole_diameter" if at.bulge.value[edge] < 0 else "disc_diameter"
    if abs(abs(float(at.bend.value[edge])) - pi / 2) < SEMICIRCLE:
        return "end_radius"
    size = layout.sizes[loop]
    ref = layout.refs[edge]
    before, after = (loop, (ref[1] - 1) % size), (loop, (ref[1] + 1) % size)
    lines = not (layout.arcs[layout.number(before)] or layout.arcs[layout.number(after)])
    return "corner_radius" if lines and {(before, ref), (ref, after)} <= tangent else "arc_radius"
