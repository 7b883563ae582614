"""K_h = {v in V_h : B v <= g}: supports and contact rows, and one unknown for each of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Mask
from ..constraints import BasisTransformation, Conditions, change_of_basis
from ..contact import ContactLine, joined, kept_lines, merged
from ..fem import Space
from ..problem import Problem
from .supports import support_conditions


@dataclass(frozen=True, eq=False)
class AdmissibleSet:
    """K_h of HH81 (2.3), (2.5), (2.10), on n node values for each component.

    Attributes
    ----------
    lines : list of ContactLine
        The contact pairs with the points that carry rows, m in all.
    conditions : Conditions
        Gamma_u and Gamma_0 at nodes.
    B : sparse (m, 2n)
        Contact rows on node values, all pairs in order; without a unit.
    g : ndarray (m,)
        Their bounds, lengths.
    equality : ndarray of bool (m,)
        Rows that hold with equality, Remark 3.3.
    basis : BasisTransformation
        Unknowns in which rows and prescribed values are single unknowns.
    """

    lines: list[ContactLine]
    conditions: Conditions
    B: sp.csr_array
    g: Array
    equality: Mask
    basis: BasisTransformation


def admissible_set(problem: Problem, space: Space, found: Sequence[ContactLine]) -> AdmissibleSet:
    """K_h for the contact points `found` of each pair.

    Raises
    ------
    ValueError
        Prescribed displacements that violate a contact row.
    """
    trace = space.trace
    conditions = support_conditions(problem, trace)  # (3.6), (3.8)
    lines, rows = merged(list(found), joined(list(found), trace))  # (2.3), (2.5), (2.10)
    length = float(np.abs(trace.curve).max())
    stiffness = space.stiffness() if rows.coupling.nnz else None  # else all rows have one host
    basis = change_of_basis(conditions, rows, length, stiffness)
    rows = rows.select(basis.kept)
    return AdmissibleSet(
        lines=kept_lines(lines, basis.kept),
        conditions=conditions,
        B=rows.matrix,
        g=rows.g,
        equality=rows.equality,
        basis=basis,
    )
