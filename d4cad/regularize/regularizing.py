"""From a fitted sketch to the one that its designer drew: relations found, solved for jointly, and kept if they may."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import isfinite, sqrt

import numpy as np

from d4cad.edges import Floats
from d4cad.errors import GeometryError, InputError
from d4cad.regularize.candidates import single_candidates
from d4cad.regularize.equations import Equations, equations, gauge
from d4cad.regularize.evidence import Evidence
from d4cad.regularize.measures import Measures
from d4cad.regularize.naming import named_dimensions
from d4cad.regularize.parameters import Parameters
from d4cad.regularize.patterns import pattern_candidates
from d4cad.regularize.rounding import MILLIMETRES, round_candidates
from d4cad.regularize.selection import LIMIT, TOLD, Belief, Candidate, believed
from d4cad.regularize.solving import SATISFIED, solved
from d4cad.relations import Relation
from d4cad.sketch import Sketch

PASSES = 5
RENEWALS = 3
ORDER = (
    "width", "height", "horizontal", "vertical", "tangent", "symmetric", "congruent", "polar", "row", "equal_radius",
    "concentric", "collinear", "parallel", "perpendicular", "equal_length", "angle",
)  # fmt: skip
"""The order in which relations are told: what makes others follow comes first."""


@dataclass(frozen=True, slots=True)
class Scale:
    """What a unit of the sketch measures: ``mm`` millimetres, or what makes the sketch ``width`` mm wide, which is kept
    then. steps: round sizes are multiples of these, in mm. Raises InputError unless one of the two is given.
    """

    mm: float | None = None
    width: float | None = None
    steps: tuple[float, ...] = MILLIMETRES

    def __post_init__(self) -> None:
        if (self.mm is None) == (self.width is None):
            raise InputError("a scale is either mm per unit or the width in mm")


@dataclass(frozen=True, slots=True, eq=False)
class Regularized:
    """sketch: with its relations and dimensions. params: its numbers, laid out as `Parameters` says. before, after:
    loss of the most likely parameters and of these. freed: parameters that the relations take. moved: the longest way
    of a vertex (of a full circle: its radius and centre), in the sketch's unit.
    """

    sketch: Sketch
    params: Floats
    before: float
    after: float
    freed: int
    moved: float


def regularized(
    sketch: Sketch,
    evidence: Evidence,
    *,
    scale: Scale | None = None,
    renewed: Callable[[Floats], Evidence] | None = None,
) -> Regularized:
    """The sketch with the relations that the evidence makes likely, all of them exact.

    Relations that the sketch has already are kept. Others are proposed (candidates.py, patterns.py, and rounding.py if
    a ``scale`` is given), chosen by their evidence (selection.py), solved jointly with all before them (solving.py) and
    kept only if the loss rises by no more than noise would explain and no loop is crossed; of those that are refused
    together, halves are tried. ``renewed``: the evidence as it is at other parameters, with which the last solution is
    refined.
    """
    if not sketch.faces:
        return Regularized(sketch, evidence.params, 0.0, 0.0, 0, 0.0)
    work = _Work(Parameters(sketch), evidence, evidence.spread(Parameters(sketch)), evidence.loss(evidence.params))
    state = _State([Candidate(relation, 0.0) for relation in sketch.relations], evidence.params, 0)
    start = solved(sketch.relations, work.layout, evidence.params, work.spread)
    state = replace(state, params=start) if start is not None else _State([], evidence.params, 0)
    state = _grown(work, state, work.shapes)
    if scale is not None:
        xmin, _, xmax, _ = work.layout.sketched(state.params).bounds
        mm = scale.mm if scale.width is None else scale.width / (xmax - xmin)
        assert mm is not None
        if scale.width is not None and not any(c.relation.kind == "width" for c in state.kept):
            state = replace(state, kept=[*state.kept, Candidate(Relation("width", (), xmax - xmin), 0.0)])
        state = _grown(work, state, lambda at, spread, params: work.sizes(at, params, mm, scale.steps))
    params = _renewed(work, state, renewed) if renewed is not None and state.kept else state.params
    relations, freed = _told(work, [c.relation for c in state.kept], params)
    params = _exact(work.layout, relations, params)
    found = replace(work.layout.sketched(params), relations=relations)
    return Regularized(
        replace(found, dimensions=named_dimensions(found)),
        params,
        work.before,
        evidence.loss(params),
        freed,
        _longest_way(work.layout, evidence.params, params),
    )


@dataclass(frozen=True, slots=True)
class _State:
    """What holds so far, the parameters at which it does, and the number of parameters that it takes."""

    kept: list[Candidate]
    params: Floats
    rank: int


Proposals = Callable[[Measures, Measures, Floats], list[Candidate]]


@dataclass(frozen=True, slots=True, eq=False)
class _Work:
    """What stays the same throughout."""

    layout: Parameters
    evidence: Evidence
    spread: Floats
    before: float

    def shapes(self, at: Measures, spread: Measures, params: Floats) -> list[Candidate]:
        """Candidates that need no scale."""
        return [*pattern_candidates(self.layout, at, self.evidence.pixel), *single_candidates(self.layout, at, spread)]

    def sizes(self, at: Measures, params: Floats, mm: float, steps: Sequence[float]) -> list[Candidate]:
        """Candidates for round sizes."""
        return list(round_candidates(self.layout, at, self.layout.sketched(params), mm, steps))

    def tried(self, kept: Sequence[Candidate], rank: int) -> Floats | None:
        """The parameters at which all of ``kept`` hold, if the loss and the loops allow it."""
        params = solved([c.relation for c in kept], self.layout, self.evidence.params, self.spread)
        if params is None:
            return None
        try:
            self.layout.sketched(params)
        except GeometryError:
            return None
        risen = (self.evidence.loss(params) - self.before) / self.evidence.variance
        return params if isfinite(risen) and risen <= rank + LIMIT * sqrt(2 * rank) + LIMIT else None


def _grown(work: _Work, state: _State, proposals: Proposals) -> _State:
    """The state with all that is proposed at it and may be kept, until nothing more may."""
    refused: set[Relation] = set()
    for _ in range(PASSES):
        at = Measures.of(work.layout, state.params)
        spread = at.taken_to(work.spread)
        belief = Belief.nothing(work.spread.shape[1])
        for system in (
            gauge(work.layout, spread),
            *(equations(c.relation, work.layout, spread) for c in state.kept),
        ):
            if system.residual.size:
                verdict = belief.verdict(system, 0.0)
                if verdict is not None:
                    belief.believe(verdict)
        known = {c.relation for c in state.kept}
        fresh = [
            (c, _system(c, work.layout, spread)) for c in proposals(at, spread, state.params) if c.relation not in known
        ]
        # What was refused once may have come to hold by itself.
        fresh = [(c, s) for c, s in fresh if c.relation not in refused or np.abs(s.residual).max() <= SATISFIED]
        chosen = believed(fresh, belief)
        chosen = _joining(chosen, [c.relation for c in state.kept])
        if not chosen:
            break
        grown = _extended(work, state, chosen)
        refused |= {c.relation for c, _ in chosen} - {c.relation for c in grown.kept}
        if len(grown.kept) == len(state.kept):
            break
        state = grown
    return state


def _system(candidate: Candidate, layout: Parameters, spread: Measures) -> Equations:
    system = equations(candidate.relation, layout, spread)
    if candidate.spread is None:
        return system
    return system._replace(spread=np.full_like(system.spread, candidate.spread))


def _extended(work: _Work, state: _State, chosen: list[tuple[Candidate, int]]) -> _State:
    """The state with as many of the chosen as may be kept: all, or what halves of them leave."""
    kept, rank = [*state.kept, *(c for c, _ in chosen)], state.rank + sum(r for _, r in chosen)
    params = work.tried(kept, rank)
    if params is not None:
        return _State(kept, params, rank)
    if len(chosen) == 1:
        return state
    half = (len(chosen) + 1) // 2
    return _extended(work, _extended(work, state, chosen[:half]), chosen[half:])


def _joining(chosen: list[tuple[Candidate, int]], kept: Sequence[Relation]) -> list[tuple[Candidate, int]]:
    """Without the implied pairs whose edges other pairs of their kind have joined already."""
    home: dict[tuple[str, object], tuple[str, object]] = {}

    def root(key: tuple[str, object]) -> tuple[str, object]:
        while home.setdefault(key, key) != key:
            key = home[key]
        return key

    found = []
    for candidate, rank in [*((Candidate(r, 0.0), 1) for r in kept), *chosen]:
        relation = candidate.relation
        if len(relation.refs) == 2 and relation.kind not in ("tangent", "symmetric"):
            a, b = (root((relation.kind, ref)) for ref in relation.refs)
            if a == b and rank == 0:
                continue
            home[a] = b
        found.append((candidate, rank))
    return found[len(kept) :]


def _told(work: _Work, relations: Sequence[Relation], params: Floats) -> tuple[tuple[Relation, ...], int]:
    """The relations in an order of their own, without those that follow from the ones before, some kinds apart; and the
    number of parameters that all of them take.
    """
    spread = Measures.of(work.layout, params).taken_to(work.spread)
    belief = Belief.nothing(work.spread.shape[1])
    known = gauge(work.layout, spread)
    chosen = []
    order = {kind: k for k, kind in enumerate(ORDER)}
    for relation in sorted(relations, key=lambda r: (order.get(r.kind, len(order)), len(r.refs), r.refs)):
        for system in (known, equations(relation, work.layout, spread)):
            verdict = belief.verdict(system, 0.0)
            if verdict is not None:
                belief.believe(verdict)
        known = Equations(np.zeros(0), np.zeros((0, params.size)), np.zeros(0))
        chosen.append((Candidate(relation, 0.0), verdict.rank if verdict is not None else 0))
    told = tuple(c.relation for c, rank in _joining(chosen, []) if rank or c.relation.kind in TOLD)
    return told, sum(rank for _, rank in chosen)


def _renewed(work: _Work, state: _State, renewed: Callable[[Floats], Evidence]) -> Floats:
    """The parameters refined by fresh evidence at them, as long as that lowers the loss."""
    relations, params = [c.relation for c in state.kept], state.params
    loss = work.evidence.loss(params)
    for _ in range(RENEWALS):
        fresh = renewed(params)
        better = solved(relations, work.layout, fresh.params, fresh.spread(work.layout))
        if better is None:
            break
        try:
            work.layout.sketched(better)
        except GeometryError:
            break
        lower = work.evidence.loss(better)
        if not lower < loss:
            break
        params, gained, loss = better, loss - lower, lower
        if gained < 1e-3 * loss:
            break
    return params


def _exact(layout: Parameters, relations: Sequence[Relation], params: Floats) -> Floats:
    """The parameters with equal coordinates equal to the last bit, and semicircles' bulges 1."""
    params = params.copy()
    count = layout.starts[-1]
    for kind, offset in (("horizontal", 1), ("vertical", 0)):
        group = np.arange(count)
        pairs = [(k, int(layout.following[k])) for r in relations if r.kind == kind and len(r.refs) == 1
                 for k in (layout.number(r.refs[0]),)]  # fmt: skip
        if kind == "horizontal":
            pairs += [(layout.starts[loop], layout.starts[loop] + 1) for loop in np.flatnonzero(layout.circles)]
        for a, b in pairs:
            group[group == group[b]] = group[a]
        for leader in np.unique(group):
            members = 2 * np.flatnonzero(group == leader) + offset
            if members.size > 1:
                params[members] = params[members[0]]
    for loop in np.flatnonzero(layout.circles):
        for k in (layout.starts[loop], layout.starts[loop] + 1):
            params[layout.columns[k, 4]] = np.sign(params[layout.columns[k, 4]])
    return params


def _longest_way(layout: Parameters, before: Floats, after: Floats) -> float:
    count = layout.starts[-1]
    return float(np.hypot(*(after - before)[: 2 * count].reshape(-1, 2).T).max(initial=0.0))
