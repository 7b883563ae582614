"""NGSolve with a plain active set on nodal values, refactorised at each step; orders 1 and 2."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import ngsolve as ng
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from drivers.benchmark.engines import Run
from drivers.benchmark.engines.active_set import Solver
from drivers.benchmark.engines.assembled import Assembled, solved
from drivers.benchmark.scenes.meshes import Mesh, made
from drivers.benchmark.scenes.ngsolve_plane import load, matrix, nodal, numbering
from drivers.benchmark.scenes.problems import Common
from ngcontact.linalg import lower_half

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ENGINE = "NGSolve active set"


def runs(common: Common, kinds: Sequence[str], sizes: Sequence[int]) -> Iterator[Run]:
    """Runs of orders 1 and 2 on meshes of the given kinds and numbers of unknowns."""
    for kind in kinds:
        for order in (1, 2):
            for size in sizes:
                yield run(common, kind, order, made(common, kind, order, size))


def cholesky(K: sp.csr_array, order: int) -> Solver:
    """NGSolve's sparse Cholesky factorisation for the active set."""
    matrix = lower_half(K)
    right, solution = matrix.CreateColVector(), matrix.CreateRowVector()

    def solve(free: Mask, b: Array) -> Array:
        inverse = matrix.Inverse(ng.BitArray(free), inverse="sparsecholesky")
        right.FV().NumPy()[:] = b
        solution.data = inverse * right
        return solution.FV().NumPy().copy()

    return solve


def run(common: Common, kind: str, order: int, made: Mesh) -> Run:
    """One run, on a mesh curved to the order of the elements."""
    assemble = partial(assembled, common, made.copy(), order)
    return solved(ENGINE, common, kind, order, made, assemble, cholesky)


def assembled(common: Common, mesh: ng.Mesh, order: int) -> Assembled:
    """Stiffness and load, with values at the nodes of the boundary as unknowns."""
    mesh.Curve(order)
    space = ng.VectorH1(mesh, order=order)
    K, f = matrix(common, space), load(common, space).Assemble().vec.FV().NumPy().copy()
    number = numbering(mesh, order)
    return Assembled(K, f, number, nodal(number)[0] if order == 2 else None)
