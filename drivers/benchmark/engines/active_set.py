"""The plain active set that a user of any finite element code writes, one factorisation a step.

In scikit-fem with SciPy's sparse LU, isoparametric.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from drivers.benchmark.engines import Engine, Solved
from drivers.benchmark.scenes.meshes import Mesh, which
from drivers.benchmark.scenes.plane import (
    Assembled,
    Facing,
    Numbering,
    bounded,
    middles,
    moduli,
    prescribed,
    pressures,
    read,
    segments,
)
from drivers.benchmark.scenes.problems import Common

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Solver = Callable[[Mask, Array], Array]

STEPS = 100
# The ordering for symmetric matrices takes 0.6 to 0.8 of the default's time with order 2, but on
# linear triangles it is 5 times slower at 100 000 unknowns on the block, and more on the disc.
SYMMETRIC: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True},
}


def active_set(
    K: sp.csr_array, f: Array, line: Facing, fixed: Mask, value: Array, solve: Solver
) -> tuple[Array, Array, int]:
    """Min v'Kv/2 - f'v over v (n,) with v[fixed] = value[fixed] and v[line.at] >= -line.gap (m,).

    Primal-dual active set from the bounds that are attained before loading; `solve(free, b)`
    factorises K and returns x with K x = b in the free unknowns, zero elsewhere. Returns v, the
    multipliers (m,) of the bounds, which are not negative, and the number of linear systems. Raises
    RuntimeError if the set still changes after a hundred steps.
    """
    at, lower = line.at, -line.gap
    active = lower >= 0
    for step in range(1, STEPS + 1):
        free = ~fixed
        free[at[active]] = False
        v = np.where(fixed, value, 0.0)
        v[at[active]] = lower[active]
        v += solve(free, f - K @ v)
        force = np.where(active, (K @ v - f)[at], 0.0)
        following = np.where(active, force > 0, v[at] < lower)
        if (following == active).all():
            return v, force, step
        active = following
    raise RuntimeError(f"the active set still changes after {STEPS} steps")


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
    common: Common,
    order: int,
    assemble: Callable[[], Assembled],
    factor: Callable[[sp.csr_array, int], Solver] = lu,
) -> Solved:
    """What `assemble` returns, solved with `factor`; both are timed."""
    started = time.perf_counter()
    assembled = assemble()
    K, f, line = bounded(common, assembled)
    fixed, value = prescribed(common, assembled.numbering)
    v, force, steps = active_set(K, f, line, fixed, value, factor(K, order))
    seconds = time.perf_counter() - started
    reading = read(common, line.x, force, v[line.at] + line.gap, order)
    return Solved(seconds, steps, float(v @ (K @ v)) / 2, reading)


def scikit_basis(skfem: Any, common: Common, made: Mesh, order: int) -> Any:
    """Vector basis on the triangles; the middles of the contact edges lie on the curve."""
    mesh = skfem.MeshTri(*(np.ascontiguousarray(a.T) for a in (made.points, made.triangles)))
    if order == 1:
        return skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP1()))
    places = np.vstack([made.points, middles(common, made, mesh.facets.T)])
    curved = skfem.MeshTri2(np.ascontiguousarray(places.T), mesh.t)
    return skfem.Basis(curved, skfem.ElementVector(skfem.ElementTriP2()))


def by_scikit(modules: Any, common: Common, made: Mesh, order: int) -> Solved:
    """With scikit-fem."""
    skfem, *_ = modules

    def assembled() -> Assembled:
        basis = scikit_basis(skfem, common, made, order)
        K = skfem.models.elasticity.linear_elasticity(*moduli(common)).assemble(basis)
        nodes = basis.nodal_dofs if order == 1 else np.hstack([basis.nodal_dofs, basis.facet_dofs])
        f, form = (
            np.zeros(basis.N),
            skfem.LinearForm(lambda v, w: -(w.n[0] * v[0] + w.n[1] * v[1])),
        )
        for name, pressure in pressures(common).items():
            facets = which(basis.mesh.facets.T, made.edges[name])
            f += pressure * form.assemble(basis.boundary(facets))
        number = Numbering(made.points, nodes, segments(made, order, basis.mesh.facets.T))
        return Assembled(sp.csr_array(K), f, number)

    return solved(common, order, assembled)


SCIKIT = Engine("scikit-fem active set", by_scikit, ("skfem", "skfem.models.elasticity"))
