"""FElupe with the same plain active set and SciPy's sparse LU, isoparametric orders 1 and 2."""

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
from drivers.benchmark.scenes.nodes import interleaved
from drivers.benchmark.scenes.plane import Numbering, pressures
from drivers.benchmark.scenes.problems import Common
from drivers.benchmark.scenes.reading import WEIGHTS

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

ENGINE = "FElupe active set"
QUADRATURE = 5  # degree with order 2; the default one, 2, changes the disc's errors by a percent


def runs(common: Common, kinds: Sequence[str], sizes: Sequence[int]) -> Iterator[Run]:
    """Runs of orders 1 and 2 on meshes of the given kinds and numbers of unknowns.

    Raises
    ------
    NotInstalledError
        FElupe is missing.
    """
    [felupe] = needed(ENGINE, "felupe")
    return all_solved(ENGINE, common, kinds, sizes, partial(assembled, felupe))


def quadratic(felupe: ModuleType) -> Any:
    """Quadratic triangle; FElupe's own (11.3.0) has a wrong slope of its last shape function."""

    def gradient(rs: Array) -> Array:
        r, s = rs
        t = 1 - r - s
        corners = [[1 - 4 * t, 1 - 4 * t], [4 * r - 1, 0 * s], [0 * r, 4 * s - 1]]
        between = [[4 * (t - r), -4 * r], [4 * s, 4 * r], [-4 * s, 4 * (t - s)]]
        return np.array(corners + between)

    element = felupe.QuadraticTriangle()
    element.gradient = gradient
    return element


def region(felupe: ModuleType, places: Array, cells: Indices) -> Any:
    """Triangles with their shape functions at the points of quadrature."""
    if cells.shape[1] == 3:
        return felupe.RegionTriangle(felupe.Mesh(places, cells, "triangle"))
    quadrature = felupe.TriangleQuadrature(order=QUADRATURE)
    return felupe.Region(felupe.Mesh(places, cells, "triangle6"), quadratic(felupe), quadrature)


def load(common: Common, numbering: Numbering, order: int) -> Array:
    """Pressures on straight boundaries (n,); FElupe has no regions of sides of triangles."""
    f = np.zeros(numbering.unknown.size)
    for name, pressure in pressures(common).items():
        nodes = numbering.segments[name]
        x, y = (numbering.points[nodes[:, -1]] - numbering.points[nodes[:, 0]]).T
        # Bodies are on the left of their boundaries.
        for unknown, component in zip(numbering.unknown, (-y, x), strict=True):
            np.add.at(f, unknown[nodes], pressure * np.outer(component, WEIGHTS[order]))
    return f


def assembled(felupe: ModuleType, common: Common, made: Mesh, order: int) -> Assembled:
    """Stiffness and load on vertices and triangles of the common mesh."""
    places, cells, numbering = interleaved(common, made, order)
    field = felupe.FieldPlaneStrain(region(felupe, places, cells), dim=2)
    [law] = common.problem.materials.values()
    material = felupe.LinearElastic(E=law.E, nu=law.nu)  # type: ignore[union-attr]
    K = felupe.SolidBody(material, felupe.FieldContainer([field])).assemble.matrix()
    return Assembled(sp.csr_array(K), load(common, numbering, order), numbering)
