"""A plain active set on what another code has assembled, timed and read off."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from drivers.benchmark.engines import Run
from drivers.benchmark.engines.active_set import Solver, active_set
from drivers.benchmark.scenes.meshes import Mesh, made
from drivers.benchmark.scenes.plane import Numbering, bounded
from drivers.benchmark.scenes.problems import Common
from drivers.benchmark.scenes.reading import read

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# The ordering for symmetric matrices takes 0.6 to 0.8 of the default's time with order 2, but on
# linear triangles it is 5 times slower at 100 000 unknowns on the block, and more on the disc.
SYMMETRIC: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True},
}


@dataclass(frozen=True, eq=False)
class Assembled:
    """Elasticity of a common problem in a code's own unknowns.

    Attributes
    ----------
    K : csr_array
        Stiffness (n, n).
    f : Array
        Load (n,).
    numbering : Numbering
        Unknowns of the nodes.
    basis : csr_array, optional
        As in `plane.bounded`.
    """

    K: sp.csr_array
    f: Array
    numbering: Numbering
    basis: sp.csr_array | None = None


def lu(K: sp.csr_array, order: int) -> Solver:
    """SciPy's sparse LU factorisation of the free part, for the active set."""

    def solve(free: Mask, b: Array) -> Array:
        at = np.flatnonzero(free)
        factor = splu(K[at][:, at].tocsc(), **SYMMETRIC if order == 2 else {})
        x = np.zeros(len(b))
        x[at] = factor.solve(b[at])
        return x

    return solve


def solved(
    engine: str,
    common: Common,
    kind: str,
    order: int,
    mesh: Mesh,
    assemble: Callable[[], Assembled],
    factor: Callable[[sp.csr_array, int], Solver] = lu,
) -> Run:
    """One run: what `assemble` returns, solved with `factor`; both are timed."""
    mesh.read()
    started = time.perf_counter()
    own = assemble()
    problem, line = bounded(common, own.K, own.f, own.numbering, own.basis)
    v, force, steps = active_set(problem, factor(problem.K, order))
    seconds = time.perf_counter() - started
    return Run(
        engine=engine,
        problem=common.name,
        mesh_kind=kind,
        order=order,
        unknowns=len(own.f),
        seconds_mesh=mesh.seconds,
        seconds=seconds,
        steps=steps,
        energy=float(v @ (problem.K @ v)) / 2,
        **asdict(read(common, line.x, force, v[line.at] + line.gap, order)),
    )


def all_solved(
    engine: str,
    common: Common,
    kinds: Sequence[str],
    sizes: Sequence[int],
    assembled: Callable[[Common, Mesh, int], Assembled],
) -> Iterator[Run]:
    """Runs of orders 1 and 2 on meshes of the given kinds and numbers of unknowns."""
    for kind in kinds:
        for order in (1, 2):
            for size in sizes:
                mesh = made(common, kind, order, size)
                assemble = partial(assembled, common, mesh, order)
                yield solved(engine, common, kind, order, mesh, assemble)
