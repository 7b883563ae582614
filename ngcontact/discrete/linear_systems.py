"""Which linear systems serve a discrete problem: a factorisation, or multigrid."""

from __future__ import annotations

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ..arrays import Integers, Mask
from ..linalg import IterativeSystems, Multigrid, cholesky, coarsenings, refined_share
from ..qp import BorderedSystems, QuadraticProgram

# Unknowns by order from which multigrid is the faster one, on one thread: at 80 000 of orders 1
# and 2 both take the same time, of order 3 at a million; it always takes less memory. See
# docs/performance.md.
LARGE = {1: 100_000, 2: 100_000}
FEWEST = 0.7  # share of the unknowns that must be gone in the coarsest space


def linear_systems(
    program: QuadraticProgram,
    matrix: ng.BaseMatrix,
    T: sp.csr_array,
    parents: Integers,
    nodes: Integers,
) -> BorderedSystems:
    """Systems of a discrete problem: by multigrid where it is large and has coarser spaces.

    Parameters
    ----------
    program : QuadraticProgram
    matrix : ng.BaseMatrix
        Its matrix for NGSolve.
    T, parents, nodes
        See `hierarchy.coarsenings`.
    """
    factor, order = cholesky(matrix), nodes.shape[1] - 1
    size = program.b.size
    coarsest = 2 * len(parents) * (1 - refined_share(parents))
    half = matrix.nze < program.K.nnz  # all that a factorisation reads
    if half or size < LARGE.get(order, np.inf) or coarsest > (1 - FEWEST) * size:
        return BorderedSystems(program, factor)

    def prepare(free: Mask) -> Multigrid:
        return Multigrid(matrix, coarsenings(T, parents, nodes), free)

    return IterativeSystems(program, factor, prepare)
