"""scikit-fem with the same plain active set and SciPy's sparse LU, isoparametric orders 1 and 2."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from drivers.benchmark.engines import Run, needed
from drivers.benchmark.engines.assembled import Assembled, all_solved
from drivers.benchmark.scenes.meshes import Mesh
from drivers.benchmark.scenes.nodes import middles, segments
from drivers.benchmark.scenes.plane import Numbering, moduli, pressures
from drivers.benchmark.scenes.problems import Common
from drivers.benchmark.scenes.triangles import which

Array = NDArray[np.float64]

ENGINE = "scikit-fem active set"


def runs(common: Common, kinds: Sequence[str], sizes: Sequence[int]) -> Iterator[Run]:
    """Runs of orders 1 and 2 on meshes of the given kinds and numbers of unknowns.

    Raises
    ------
    NotInstalledError
        scikit-fem is missing.
    """
    skfem, *_ = needed(ENGINE, "skfem", "skfem.models.elasticity")
    return all_solved(ENGINE, common, kinds, sizes, partial(assembled, skfem))


def space(skfem: ModuleType, common: Common, made: Mesh, order: int) -> Any:
    """Vector basis on the triangles; the middles of the contact edges lie on the curve."""
    mesh = skfem.MeshTri(*(np.ascontiguousarray(a.T) for a in (made.points, made.triangles)))
    if order == 1:
        return skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP1()))
    places = np.vstack([made.points, middles(common, made, mesh.facets.T)])
    curved = skfem.MeshTri2(np.ascontiguousarray(places.T), mesh.t)
    return skfem.Basis(curved, skfem.ElementVector(skfem.ElementTriP2()))


def load(skfem: ModuleType, common: Common, made: Mesh, basis: Any) -> Array:
    """Pressures on the boundary (n,)."""
    f = np.zeros(basis.N)
    form = skfem.LinearForm(lambda v, w: -(w.n[0] * v[0] + w.n[1] * v[1]))
    for name, pressure in pressures(common).items():
        facets = which(basis.mesh.facets.T, made.edges[name])
        f += pressure * form.assemble(basis.boundary(facets))
    return f


def assembled(skfem: ModuleType, common: Common, made: Mesh, order: int) -> Assembled:
    """Stiffness and load on vertices and triangles of the common mesh."""
    basis = space(skfem, common, made, order)
    K = skfem.models.elasticity.linear_elasticity(*moduli(common)).assemble(basis)
    nodes = basis.nodal_dofs if order == 1 else np.hstack([basis.nodal_dofs, basis.facet_dofs])
    numbering = Numbering(made.points, nodes, segments(made, order, basis.mesh.facets.T))
    return Assembled(sp.csr_array(K), load(skfem, common, made, basis), numbering)
