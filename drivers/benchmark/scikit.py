"""scikit-fem with the same plain active set and SciPy's sparse LU, isoparametric orders 1 and 2."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from types import ModuleType
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from drivers.benchmark import Run, needed
from drivers.benchmark.active_set import Solver, active_set
from drivers.benchmark.meshes import Mesh, made
from drivers.benchmark.plane import Numbering, bounded, moduli, pressures
from drivers.benchmark.problems import Common
from drivers.benchmark.reading import read

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

ENGINE = "scikit-fem active set"
# The ordering for symmetric matrices takes 0.6 to 0.8 of the default's time with order 2, but on
# linear triangles it is 5 times slower at 100 000 unknowns on the block, and more on the disc.
SYMMETRIC: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True},
}


def runs(common: Common, kinds: Sequence[str], sizes: Sequence[int]) -> Iterator[Run]:
    """Runs of orders 1 and 2 on meshes of the given kinds and numbers of unknowns.

    Raises
    ------
    NotInstalledError
        scikit-fem is missing.
    """
    skfem, *_ = needed(ENGINE, "skfem", "skfem.models.elasticity")
    for kind in kinds:
        for order in (1, 2):
            for size in sizes:
                yield run(skfem, common, kind, order, made(common, kind, order, size))


def space(skfem: ModuleType, common: Common, made: Mesh, order: int) -> Any:
    """Vector basis on the triangles; the middles of the contact edges lie on the curve."""
    mesh = skfem.MeshTri(*(np.ascontiguousarray(a.T) for a in (made.points, made.triangles)))
    if order == 1:
        return skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP1()))
    places = skfem.MeshTri2.from_mesh(mesh).doflocs.copy()  # vertices, then middles of facets
    for ends in contact_edges(common, made):
        at = len(made.points) + facets(mesh, ends)
        places[:, at] = common.on_curve(places[:, at].T).T
    curved = skfem.MeshTri2(places, mesh.t)
    return skfem.Basis(curved, skfem.ElementVector(skfem.ElementTriP2()))


def contact_edges(common: Common, made: Mesh) -> list[Indices]:
    """End vertices (k, 2) of the edges of each side of the pair."""
    [contact] = common.problem.contact
    sides = (contact.secondary, contact.primary)
    return [made.edges[name] for name in sides if name is not None]


def facets(mesh: Any, ends: Indices) -> Indices:
    """Numbers (k,) of the facets with the given end vertices (k, 2)."""
    count = mesh.facets.max() + 1
    keys = mesh.facets.min(axis=0) * count + mesh.facets.max(axis=0)
    sorter = np.argsort(keys)
    wanted = ends.min(axis=1) * count + ends.max(axis=1)
    return sorter[np.searchsorted(keys, wanted, sorter=sorter)]


def numbering(basis: Any, made: Mesh, order: int) -> Numbering:
    """Vertices, then facets."""
    if order == 1:
        return Numbering(made.points, basis.nodal_dofs, made.edges)
    segments = {}
    for name, ends in made.edges.items():
        middle = len(made.points) + facets(basis.mesh, ends)
        segments[name] = np.column_stack([ends[:, 0], middle, ends[:, 1]])
    return Numbering(made.points, np.hstack([basis.nodal_dofs, basis.facet_dofs]), segments)


def load(skfem: ModuleType, common: Common, made: Mesh, basis: Any) -> Array:
    """Pressures on the boundary (n,)."""
    f = np.zeros(basis.N)
    form = skfem.LinearForm(lambda v, w: -(w.n[0] * v[0] + w.n[1] * v[1]))
    for name, pressure in pressures(common).items():
        edges = facets(basis.mesh, made.edges[name])
        f += pressure * form.assemble(basis.boundary(edges))
    return f


def lu(K: sp.csr_matrix, order: int) -> Solver:
    """SciPy's sparse LU factorisation of the free part, for the active set."""

    def solve(free: Mask, b: Array) -> Array:
        at = np.flatnonzero(free)
        factor = splu(K[at][:, at].tocsc(), **SYMMETRIC if order == 2 else {})
        x = np.zeros(len(b))
        x[at] = factor.solve(b[at])
        return x

    return solve


def run(skfem: ModuleType, common: Common, kind: str, order: int, made: Mesh) -> Run:
    """One run on vertices and triangles of the common mesh."""
    made.read()
    started = time.perf_counter()
    basis = space(skfem, common, made, order)
    K = skfem.models.elasticity.linear_elasticity(*moduli(common)).assemble(basis)
    f = load(skfem, common, made, basis)
    problem, line = bounded(common, K.tocsr(), f, numbering(basis, made, order), None)
    v, force, steps = active_set(problem, lu(problem.K, order))
    seconds = time.perf_counter() - started
    return Run(
        engine=ENGINE,
        problem=common.name,
        mesh_kind=kind,
        order=order,
        unknowns=basis.N,
        seconds_mesh=made.seconds,
        seconds=seconds,
        steps=steps,
        energy=float(v @ (problem.K @ v)) / 2,
        **asdict(read(common, line.x, force, v[line.at] + line.gap, order)),
    )
