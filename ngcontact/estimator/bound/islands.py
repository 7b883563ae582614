"""Stresses balanced once more where they miss much of their data.

Where F or P are no polynomials s balances projections of them. On a triangle T where that counts,
the stress s' nearest to sigma_h with the tractions of s on inner sides and on Gamma_u, with P and
p* on the others, and -div s' = F, is sought once more: of a higher degree where F is smooth, else
on parts of T, where again F and P are met in projections. s' may stand for s on T, with what it
misses itself; both have the same resultants, for the rules on T are those on its parts.
"""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from ...problem import Problem
from .cells import Cells
from .elements import WHOLE, Element, elements_of
from .missed import data_norms
from .norms import SETTLED, forces_missed, residuals, smallest_moduli, stress_norms
from .parts import PARTS, divided, pattern
from .program import dual_program, exerted
from .tractions import Given, side_rule, tractions_of

COUNTS = 0.04  # of |s - sigma_h|^2, what may be added by data where nothing is balanced again
RAISED = 3  # degrees on whole triangles
LEAST = 3  # degree on parts: lower ones do not meet all tractions
AT_ONCE = 200  # triangles


@dataclass(frozen=True, eq=False)
class Level:
    """A stress on n triangles.

    Attributes
    ----------
    cells : Cells
    elements : list of Element
    coefficients : list of ndarray (b, m)
        Of the stress.
    look : ndarray of int (n, 3)
        Rules of forces on each, as of `elements_of`.
    distance, loads : ndarray (n,)
        |s - sigma_h|, and norms of what s misses of the data.
    """

    cells: Cells
    elements: list[Element]
    coefficients: list[Array]
    look: Index
    distance: Array
    loads: Array


def once_more(
    problem: Problem,
    displacement: ng.CoefficientFunction,
    given: Given,
    level: Level,
    degree: int,
    scale: float,
    allowed: float | None = None,
) -> tuple[Array, Array]:
    """`Level.distance` and `.loads`, (n,) each, of the better of both stresses on each triangle.

    Parameters
    ----------
    problem : Problem
    displacement : CoefficientFunction
        u_h.
    given : Given
    level : Level
        The stress in equilibrium so far.
    degree : int
        Of stresses on straight triangles.
    scale : float
        The largest stress, beside which equilibrium is measured.
    allowed : float, optional
        What may be added to B^2; for the whole mesh without.
    """
    c, D = level.distance.copy(), level.loads.copy()
    limit = COUNTS * float(c @ c) if allowed is None else allowed
    rule, depth, thirds = level.look.T
    fine = (depth > 0) | (rule >= 2 * degree + WHOLE)  # rules that see what higher degrees miss
    for m, third in ((1, False), (PARTS, False), (PARTS, True)):
        lost = (c + D) ** 2 - c**2
        order = np.argsort(lost)
        at = np.sort(order[np.cumsum(lost[order]) > limit])
        some = at[(fine if m == 1 else depth > 0)[at] & (thirds[at] == third)]
        for start in range(0, len(some), AT_ONCE):
            here = some[start : start + AT_ONCE]
            share = limit * len(here) / len(some)
            one, two = _islands(
                problem, displacement, given, level, here, degree, scale, (m, third), share
            )
            better = one + two < c[here] + D[here]
            c[here[better]], D[here[better]] = one[better], two[better]
    return c, D


def _islands(
    problem: Problem,
    displacement: ng.CoefficientFunction,
    given: Given,
    level: Level,
    at: Index,
    degree: int,
    scale: float,
    division: tuple[int, bool],
    allowed: float,
) -> tuple[Array, Array]:
    """`Level.distance` and `.loads` of s' on triangles `at` (b,); infinite without equilibrium.

    `division` is that of `divided`; `allowed` may be added to B^2 on these triangles.
    """
    parts, k = divided(level.cells, at, *division), len(pattern(*division)[1])
    look = np.repeat(level.look[at], k, axis=0)
    n, raised = len(look), degree + RAISED if division[0] == 1 else max(degree, LEAST)
    look[:, 1] -= division[0] > 1
    mu, elements = elements_of(problem, parts, displacement, raised, look)
    rule = side_rule(parts, given.breaks, np.flatnonzero(~parts.inner))
    owner = parts.owner[rule.side]
    own = tractions_of(level.elements, level.coefficients, at[owner // k], rule.x, rule.normal)
    asked = given.asked(parts, rule, own)
    moments = rule.moments(mu, asked)
    nothing = np.zeros((len(moments), 0))
    program = dual_program(mu, elements, np.zeros(len(moments), dtype=bool), nothing, [])
    found = program.nearest(elements, moments).coefficients
    left = residuals(parts, mu, moments - exerted(elements, found)[0], scale)
    norms = stress_norms(elements, found, n)
    have = tractions_of(elements, found, owner, rule.x, rule.normal)
    forces, moduli = forces_missed(elements, n), smallest_moduli(elements, n)
    data = data_norms(parts, forces, rule.missed(parts, asked - have, scale), moduli)
    finer = Level(parts, elements, found, look, norms.distance, data)
    both = finer.distance, finer.loads
    if division[0] > 1 and look[:, 1].any():
        both = once_more(problem, displacement, given, finer, raised, scale, allowed)
    settled = left.reshape(-1, k).max(axis=1) <= SETTLED
    one, two = (np.linalg.norm(z.reshape(-1, k), axis=1) for z in both)
    return np.where(settled, one, np.inf), np.where(settled, two, np.inf)
