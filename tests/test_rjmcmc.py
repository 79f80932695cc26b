"""The RJMCMC baseline: its chain has the distribution that it must have, and it fits trees."""

from __future__ import annotations

from collections import Counter
from itertools import product
from math import exp, log
from typing import Any

import numpy as np
import pytest

from d4cad.baselines.rjmcmc import Annealing, BranchingSystem, Derivation, Moves, State, reflected, step
from d4cad.baselines.trees import anneal, branching_system, grown
from d4cad.bench import coverage
from d4cad.canvas import Canvas
from d4cad.errors import InputError
from d4cad.grammars.tree.structure import table_of
from d4cad.registry import make_grammar
from d4cad.sketch import Loop, Sketch

TOY = BranchingSystem(((0.2, 0.5, 0.3), (0.5, 0.3, 0.2)), (0.0,), (1.0,))
"""At most seven symbols: 1 + 3 + 9 trees, each symbol with a number in [0, 1]."""
COLD = Annealing(40.0, 0.3)
PER_SYMBOL, PER_NUMBER = 0.4, 2.0


def toy_energy(derivation: Derivation) -> float:
    """Makes the density known: symbols and numbers each pay for themselves, but two-legged roots get a rebate."""
    rebate = 1.5 if np.count_nonzero(derivation.depths == 1) == 2 else 0.0
    return PER_SYMBOL * derivation.size + PER_NUMBER * float(derivation.numbers.sum()) - rebate


def tree(*legs: int) -> tuple[int, ...]:
    """Depths of the symbols of a tree whose root has children with so many children each."""
    return (0, *(depth for count in legs for depth in (1, *[2] * count)))


TREES = [tree(*legs) for count in range(3) for legs in product(range(3), repeat=count)]


def exact(temperature: float) -> dict[tuple[int, ...], float]:
    """The probability of every tree: its prior times the integral of exp(-E / T) over its numbers."""
    weights = {}
    mass = (1 - exp(-PER_NUMBER / temperature)) / (PER_NUMBER / temperature)
    for depths in TREES:
        n, legs = len(depths), depths.count(1)
        prior = TOY.children[0][legs]
        for k, depth in enumerate(depths):
            if depth == 1:
                count = 0
                while k + 1 + count < n and depths[k + 1 + count] == 2:
                    count += 1
                prior *= TOY.children[1][count]
        rebate = exp(1.5 / temperature) if legs == 2 else 1.0
        weights[depths] = prior * exp(-PER_SYMBOL * n / temperature) * rebate * mass**n
    total = sum(weights.values())
    return {depths: weight / total for depths, weight in weights.items()}


def test_the_toy_has_thirteen_trees() -> None:
    assert len(TREES) == len(set(TREES)) == 13
    found = exact(1e9)  # hot: the prior
    for depths, probability in found.items():
        parents = [-1 if d == 0 else max(i for i in range(k) if depths[i] == d - 1) for k, d in enumerate(depths)]
        derivation = Derivation(np.array(parents), np.zeros((len(depths), 1)), np.array(depths))
        assert TOY.log_probability(derivation) == pytest.approx(log(probability), abs=1e-6)


@pytest.mark.parametrize("focus", [1.0, 1.7])
@pytest.mark.parametrize("temperature", [1.0, 2.5])
def test_the_chain_is_stationary_on_a_toy_grammar(focus: float, temperature: float) -> None:
    rng = np.random.default_rng(5)
    moves = Moves(jumps=0.6, focus=focus)
    here = State(start := TOY.derive(0, rng), toy_energy(start))
    counts: Counter[tuple[int, ...]] = Counter()
    numbers: list[float] = []
    steps = 40_000
    for k in range(steps):
        here = step(here, TOY, toy_energy, temperature, moves, rng)
        counts[tuple(here.derivation.depths.tolist())] += 1
        if k % 10 == 0:
            numbers += here.derivation.numbers[:, 0].tolist()
    known = exact(temperature)
    assert set(counts) <= set(known)
    distance = sum(abs(counts[depths] / steps - p) for depths, p in known.items()) / 2
    assert distance < 0.025
    # A number has density a exp(-a u) / (1 - exp(-a)) in [0, 1], whatever the tree.
    a = PER_NUMBER / temperature
    assert np.mean(numbers) == pytest.approx(1 / a - 1 / (exp(a) - 1), abs=0.015)
    assert np.mean(np.array(numbers) < 0.3) == pytest.approx((1 - exp(-0.3 * a)) / (1 - exp(-a)), abs=0.02)


def test_a_wrong_acceptance_ratio_would_be_noticed() -> None:
    """Without the ratio of the choices of a symbol the chain favours trees of other sizes by far more than noise."""
    known = exact(1.0)
    wrong = {depths: p / len(depths) for depths, p in known.items()}
    total = sum(wrong.values())
    assert sum(abs(wrong[d] / total - p) for d, p in known.items()) / 2 > 4 * 0.025


def test_derivations_follow_the_system() -> None:
    rng = np.random.default_rng(0)
    counts = Counter(tuple(TOY.derive(0, rng).depths.tolist()) for _ in range(20_000))
    prior = exact(1e9)
    assert sum(abs(counts[d] / 20_000 - p) for d, p in prior.items()) / 2 < 0.02
    deep = TOY.derive(2, rng)
    assert deep.parents.tolist() == [-1]
    assert deep.depths.tolist() == [2]


def test_a_replaced_subtree_leaves_the_rest() -> None:
    whole = Derivation(np.array([-1, 0, 1, 1, 0, 4]), np.arange(6.0)[:, None], np.array([0, 1, 2, 2, 1, 2]))
    assert [whole.end(k) for k in range(6)] == [6, 4, 3, 4, 6, 6]
    part = Derivation(np.array([-1]), np.array([[9.0]]), np.array([1]))
    less = whole.replaced(1, part)
    assert less.parents.tolist() == [-1, 0, 0, 2]
    assert less.numbers[:, 0].tolist() == [0, 9, 4, 5]
    more = less.replaced(1, Derivation(np.array([-1, 0, 0]), np.array([[7.0], [8.0], [6.0]]), np.array([1, 2, 2])))
    assert more.parents.tolist() == [-1, 0, 1, 1, 0, 4]
    assert more.depths.tolist() == whole.depths.tolist()
    assert whole.replaced(0, less).parents.tolist() == less.parents.tolist()


def test_moves_are_folded_into_their_range() -> None:
    low, high = np.array([0.0, -1.0]), np.array([1.0, 3.0])
    assert reflected(np.array([1.25, -1.5]), low, high) == pytest.approx([0.75, -0.5])
    assert reflected(np.array([-2.25, 8.0]), low, high) == pytest.approx([0.25, 0.0])


def test_systems_that_make_no_sense_are_refused() -> None:
    with pytest.raises(InputError, match="sum to 1"):
        BranchingSystem(((0.5, 0.4),), (0.0,), (1.0,))
    with pytest.raises(InputError, match="ranges"):
        BranchingSystem(((1.0,),), (1.0,), (1.0,))


def test_temperatures_fall_geometrically() -> None:
    annealing = Annealing(100.0, 1.0)
    assert [annealing.at(share) for share in (0, 0.5, 1, 2)] == pytest.approx([100, 10, 1, 1])


@pytest.mark.parametrize("variant", ["Tr-1", "Tr-F"])
def test_annealing_fits_a_tree(variant: str) -> None:
    canvas = Canvas.square(48)
    corners = ((-0.2, -1.3), (0.2, -1.3), (0.3, 0.6), (-0.3, 0.6))
    target = coverage(Sketch.from_loops([Loop(corners, (0.0, 0.0, 0.5, 0.0))]), canvas)
    grammar: Any = make_grammar("tree", "paper", canvas, variant, target)
    found = anneal(target, canvas, grammar, np.random.default_rng(3), steps=2500, annealing=COLD)
    losses = [record.loss for record in found.history]
    assert losses == sorted(losses, reverse=True)
    missed = grammar.rasterize(found.program, canvas).coverage - target
    assert found.loss == pytest.approx(float(np.mean(missed**2)))
    assert found.loss < 0.5 * float(np.mean(target**2))
    assert grammar.repair(found.program).program is found.program or variant == "Tr-F"
    again = anneal(target, canvas, grammar, np.random.default_rng(3), steps=2500, annealing=COLD)
    assert np.array_equal(again.program.params, found.program.params)


def test_a_run_without_an_end_is_refused() -> None:
    canvas = Canvas.square(16)
    grammar: Any = make_grammar("tree", "paper", canvas)
    endless: tuple[dict[str, Any], ...] = ({}, {"seconds": 0.0})
    for how in endless:
        with pytest.raises(InputError, match="a run needs a number of steps or of seconds above 0"):
            anneal(np.zeros((16, 16)), canvas, grammar, np.random.default_rng(0), **how)


def test_what_is_derived_is_a_tree_within_its_limits() -> None:
    canvas = Canvas.square(48)
    for variant, columns in (("Tr-1", 2), ("Tr-F", 3)):
        grammar: Any = make_grammar("tree", "paper", canvas, variant, np.ones(canvas.shape))
        axiom = grammar.axiom(canvas)
        system = branching_system(axiom)
        assert len(system.low) == columns
        derivation = system.derive(0, np.random.default_rng(1))
        program = grown(derivation, axiom)
        assert len(program.structure.parents) == derivation.size + 1
        limits, table = axiom.structure.limits, table_of(program)
        assert np.all(table[1:, 0] <= limits.length)
        assert np.all(np.abs(table[1:, 1]) <= limits.angle)
        assert np.bincount(program.structure.parent[1:]).max() <= 2
