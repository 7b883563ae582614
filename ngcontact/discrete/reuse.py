"""What a problem on the same mesh as another one has in common with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..arrays import Index
from ..constraints import BasisTransformation
from ..contact import ContactLine, contact_line
from ..fem import BoundaryTrace, Space
from ..problem import Contact, Elastic, Hooke, MeshArrays, Problem, varies
from ..qp import BorderedSystems


@dataclass(frozen=True, eq=False)
class Reduced:
    """The stiffness in the unknowns of a basis, and what solves with it.

    Attributes
    ----------
    basis : BasisTransformation
        The unknowns, n of them.
    K : sparse (n, n)
        The stiffness, force per length.
    systems : BorderedSystems
        Its linear systems, with the factorisation once there is one.
    """

    basis: BasisTransformation
    K: sp.csr_array
    systems: BorderedSystems


@dataclass(frozen=True, eq=False)
class Reusable:
    """What an earlier problem leaves to a new one on the same mesh; nothing by default.

    Attributes
    ----------
    lines : sequence of ContactLine
        The contact points it has found.
    space : Space or None
        Its V_h, if the stiffness is the same.
    reduced : Reduced or None
        That stiffness in unknowns which are, if rows and supports make the same ones again, those
        of the new problem.
    """

    lines: Sequence[ContactLine] = ()
    space: Space | None = None
    reduced: Reduced | None = None


def same_mesh(trace: BoundaryTrace, space: Space) -> bool:
    """Whether the mesh of `trace` is still as it was when `space` was made on it, in its model."""
    old = space.trace
    return (
        trace.model is old.model
        and np.array_equal(trace.nodes, old.nodes)
        and np.array_equal(trace.curve, old.curve)
        and np.array_equal(MeshArrays(trace.mesh).vertices, space.vertices)
    )


def _same_law(one: Elastic | Hooke, other: Elastic | Hooke) -> bool:
    """Whether two laws are the same numbers; functions may have changed unseen."""
    if varies(one) or varies(other) or type(one) is not type(other):
        return False
    return all(np.array_equal(value, vars(other)[name]) for name, value in vars(one).items())


def same_stiffness(problem: Problem, other: Problem) -> bool:
    """Whether two problems have the same elastic bodies."""
    laws, others = problem.materials, other.materials
    return (
        problem.model == other.model
        and laws.keys() == others.keys()
        and all(_same_law(law, others[body]) for body, law in laws.items())
    )


def _same_pair(one: Contact, other: Contact) -> bool:
    """Whether two pairs have the same points and gaps; functions may have changed unseen."""
    names = ("secondary", "primary", "direction", "bilateral", "rows", "roles")
    same = all(getattr(one, name) == getattr(other, name) for name in names)
    return same and one.gap is None and other.gap is None


def contact_lines(
    problem: Problem, trace: BoundaryTrace, known: Sequence[ContactLine]
) -> list[ContactLine]:
    """The line of each pair, a known one where it is the same.

    What an earlier pair of the same direction and gap covers is left to that one where both know
    the facing segments.
    """
    lines: list[ContactLine] = []
    for number, contact in enumerate(problem.contact):
        same = (line for line in known if _same_pair(line.contact, contact))
        taken = _taken(trace, contact, problem.contact[:number], lines)
        line = None if taken.size else next(same, None)
        if line is None:
            line = contact_line(trace, contact, taken)
        else:
            line = replace(line, searches=0)
        lines.append(line)
    return lines


def _taken(
    trace: BoundaryTrace,
    contact: Contact,
    earlier: Sequence[Contact],
    lines: Sequence[ContactLine],
) -> Index:
    """Segments (j,) of the secondary that `earlier` pairs, of these `lines`, leave nothing of."""
    taken, facing = [np.zeros(0, dtype=np.intp)], trace.segments(contact.primary)
    for pair, line in zip(earlier, lines, strict=True):
        if not _same_row(pair, contact):
            continue
        if pair.primary == contact.primary:
            taken.append(line.segments)
        elif np.intersect1d(line.facing, facing).size:
            taken.append(line.segments[line.faces])
    return np.intersect1d(np.concatenate(taken), trace.segments(contact.secondary))


def _same_row(one: Contact, other: Contact) -> bool:
    """Whether two pairs ask for the same rows where their secondaries and primaries overlap."""
    names = ("direction", "gap", "bilateral", "rows", "roles")
    return all(getattr(one, name) == getattr(other, name) for name in names)


def same_basis(one: BasisTransformation, other: BasisTransformation) -> bool:
    """Whether rows and supports make the same unknowns; bounds and values may differ."""
    return (
        np.array_equal(one.fixed, other.fixed)
        and np.array_equal(one.unknown, other.unknown)
        and one.T.shape == other.T.shape
        and (one.T != other.T).nnz == 0
    )
