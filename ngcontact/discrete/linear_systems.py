"""Which linear systems serve a discrete problem: a factorisation, or multigrid."""

from __future__ import annotations

from dataclasses import dataclass, field

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ..arrays import Integers, Mask
from ..linalg import (
    COARSEST,
    Multigrid,
    cholesky,
    coarsenings,
    iterative_systems,
    refined_share,
    truncated_multigrid,
)
from ..qp import LinearSystems, QuadraticProgram, bordered_systems

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
