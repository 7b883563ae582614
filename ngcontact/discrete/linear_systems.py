"""Which linear systems serve a discrete problem: a factorisation, or multigrid; one for a dual."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Integers, Mask
from ..errors import ConvergenceError
from ..linalg import (
    COARSEST,
    Multigrid,
    cholesky,
    coarsenings,
    iterative_systems,
    refined_share,
    truncated_multigrid,
)
from ..qp import LinearSystems, QuadraticProgram, SingularError, bordered_systems

LOWEST, HIGHEST = (
    -306,
    305,
)  # powers of ten between which sums of products keep their digits
FEWEST = 0.7  # share of the unknowns that must be gone in the coarsest space


@dataclass
class MultigridUse:
    """Where multigrid takes the place of a factorisation.

    Attributes
    ----------
    large : dict of int to int
        Unknowns by order from which it is the faster one, on one thread: at 80 000 of orders 1
        and 2 both take the same time, of order 3 at a million; it always takes less memory. See
        docs/performance.md.
    coarsest : int
        Unknowns up to which there is no coarser space, and a problem is factorised anyway.
    """

    large: dict[int, int] = field(default_factory=lambda: {1: 100_000, 2: 100_000})
    coarsest: int = COARSEST


MULTIGRID = MultigridUse()  # may be set by who measures or tests


def check_range(program: QuadraticProgram) -> None:
    """Raise where double precision holds the data but neither the forces nor the displacements."""
    p = program
    stiffness, load = p.diagonal.max(initial=0.0), np.abs(p.b).max(initial=0.0)
    given = max(np.abs(p.values).max(initial=0.0), -p.g.min(initial=0.0))
    with np.errstate(divide="ignore"):
        k, f, v = np.log10([stiffness, load, given])
    for name, size in (("displacements", max(v, f - k)), ("forces", max(f, k + v))):
        if not (size == -np.inf or LOWEST < size < HIGHEST):
            raise ValueError(
                f"moduli, loads and prescribed displacements make {name} of 1e{size:+.0f}, beyond "
                f"the range of numbers (1e{LOWEST} to 1e+{HIGHEST}); choose other units"
            )


def linear_systems(
    program: QuadraticProgram,
    matrix: ng.BaseMatrix,
    T: sp.csr_array,
    parents: Integers,
    nodes: Integers,
) -> LinearSystems:
    """Systems of a discrete problem: by multigrid where it is large and has coarser spaces.

    Parameters
    ----------
    program : QuadraticProgram
    matrix : ng.BaseMatrix
        Its matrix for NGSolve.
    T : sparse (2n, 2n)
    parents : ndarray of int (nv, 2)
    nodes : ndarray of int (k, p + 1)
        See `linalg.coarsenings`.
    """
    factor, order = cholesky(matrix), nodes.shape[1] - 1
    size = program.b.size
    small = size < MULTIGRID.large.get(order, np.inf) or size <= MULTIGRID.coarsest
    coarsest = 2 * len(parents) * (1 - refined_share(parents))
    half = matrix.nze < program.K.nnz  # all that a factorisation reads
    if small or half or coarsest > (1 - FEWEST) * size:
        return bordered_systems(program, factor)

    def prepare(free: Mask) -> Multigrid:
        return truncated_multigrid(matrix, coarsenings(T, parents, nodes, MULTIGRID.coarsest), free)

    return iterative_systems(program, factor, prepare)


@dataclass(frozen=True, eq=False)
class Influence:
    """The displacement of least energy with given jumps at active points, without loads.

    Attributes
    ----------
    unknowns : ndarray (2n,)
        Of the displacement, lengths where the jumps are lengths.
    force : ndarray (m,)
        Nodal contact forces, force per thickness.
    factorizations, back_solves : int
        Work done: one back-solve where there is a factorisation for the active set.
    """

    unknowns: Array
    force: Array
    factorizations: int
    back_solves: int


def influence(
    program: QuadraticProgram, systems: LinearSystems, active: Mask, jumps: Array
) -> Influence:
    """Move the `active` (m,) points by `jumps` (m,); supports rest, the other points are free.

    Raises
    ------
    ConvergenceError
        Active points and supports leave a rigid motion free.
    """
    null_space, zero = program.null_space, np.zeros_like(program.b)
    if null_space.pins.size and not null_space.resisted(program.unknown[active]):
        raise ConvergenceError("contact leaves a rigid motion free")
    systems.restart(replace(program, b=zero, g=jumps, values=zero))
    try:
        y, force = systems.solve(active)
    except SingularError as singular:
        raise ConvergenceError(str(singular)) from None
    finally:
        work = systems.factorizations, systems.back_solves
        systems.restart(program)
    return Influence(y, force, *work)
