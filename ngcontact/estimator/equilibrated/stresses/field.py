"""An equilibrated stress as a function on the mesh."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index
from ..data import basis

ON_LINE = 1e-9  # barycentric coordinate of a point on the line between parts, but for round-off
MIDDLE = 1 / 3  # both reference coordinates of the point about which monomials are taken


def stress_field(
    mesh: ng.Mesh, triangles: Array, parent: Index, coefficients: Array, degree: int
) -> ng.CoefficientFunction:
    """Stress (2, 2) of polynomials on triangles, some of them parts of an element.

    Parameters
    ----------
    mesh : ng.Mesh
        The mesh.
    triangles : ndarray (n, 3, 2)
        Corners.
    parent : ndarray of int (n,)
        Element of each.
    coefficients : ndarray (n, 3, m)
        (xx, yy, xy) in the polynomials of `degree`, units of stress.
    """
    count = np.bincount(parent, minlength=mesh.ne)
    order = np.argsort(parent, kind="stable")
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    parts = [order[first + np.minimum(i, count - 1)] for i in range(int(count.max()))]
    fields = [_field(mesh, triangles[at], coefficients[at], degree) for at in parts]
    total = fields[-1]
    for at, field in zip(parts[-2::-1], fields[-2::-1], strict=True):
        u, v = _coordinates(mesh, triangles[at])
        least = ng.IfPos(u - v, v, u)
        least = ng.IfPos(least + u + v - 1, 1 - u - v, least)
        total = ng.IfPos(least + ON_LINE, field, total)
    return total.Reshape((2, 2))


def _coordinates(
    mesh: ng.Mesh, corners: Array
) -> tuple[ng.CoefficientFunction, ng.CoefficientFunction]:
    """The two reference coordinates of one triangle on each element."""
    sides = np.stack([corners[:, 0] - corners[:, 2], corners[:, 1] - corners[:, 2]], axis=2)
    inverse = np.linalg.inv(sides)
    offset = -np.einsum("nij,nj->ni", inverse, corners[:, 2])
    u = _on_elements(mesh, np.column_stack([offset, inverse.reshape(-1, 4)]))
    return u[0] + u[2] * ng.x + u[3] * ng.y, u[1] + u[4] * ng.x + u[5] * ng.y


def _on_elements(mesh: ng.Mesh, values: Array) -> ng.GridFunction:
    """Values (ne, d) as a function that is constant on each element."""
    function = ng.GridFunction(ng.L2(mesh, order=0, dim=values.shape[1]))
    function.vec.FV().NumPy()[:] = values.ravel()
    return function


def _field(
    mesh: ng.Mesh, corners: Array, coefficients: Array, degree: int
) -> ng.CoefficientFunction:
    """Polynomials (2, 2) on one triangle of each element."""
    u, v = _coordinates(mesh, corners)
    u, v = 3 * (u - MIDDLE), 3 * (v - MIDDLE)
    powers = [[ng.CF(1.0), ng.CF(1.0)]]
    for _ in range(degree):
        powers.append([powers[-1][0] * u, powers[-1][1] * v])
    monomials = [powers[d - j][0] * powers[j][1] for d in range(degree + 1) for j in range(d + 1)]
    raw = coefficients @ basis(degree).change.T
    values = _on_elements(mesh, raw.reshape(len(raw), -1))
    m = len(monomials)
    xx, yy, xy = (
        sum((values[c * m + i] * monomials[i] for i in range(m)), ng.CF(0.0)) for c in range(3)
    )
    return ng.CF((xx, xy, xy, yy), dims=(2, 2)).Compile()
