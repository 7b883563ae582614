"""Stresses that are polynomials on a triangle, symmetric, in equilibrium without loads.

In the plane they are those of Airy's stress function psi: (xx, yy, xy) = (psi_yy, psi_xx, -psi_xy).
About an axis T = r s is a polynomial: with T_rr and a stress function chi

    T_rz = chi_z,  T_zz = -chi_r,  hoop = (T_rr)_r + (T_rz)_z,

so that the axial equation holds, and the radial one says what the hoop stress is. On a triangle
with a side on the axis T vanishes there, T_rr = r f and chi = r^2 eta. Polynomials are products of
Legendre's in the coordinates of each triangle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from ...arrays import Array, Index


def products(degree: int) -> tuple[Index, Index]:
    """Degrees (m,) in both coordinates of the products up to a total degree."""
    pairs = [(i, d - i) for d in range(degree + 1) for i in range(d + 1)]
    i, j = np.array(pairs, dtype=np.intp).T
    return i, j


def legendre_table(degree: int, X: Array) -> list[Array]:
    """Legendre's polynomials (..., degree + 1) and their first two derivatives."""
    P = legendre.legvander(X, degree)
    tables = [P]
    for _ in range(2):
        D = np.zeros((degree + 1, degree + 1))
        for n in range(degree):  # P'_(n+1) = (2 n + 1) P_n + P'_(n-1)
            D[n + 1] = D[n - 1] if n else 0.0
            D[n + 1, n] += 2 * n + 1
        tables.append(tables[-1] @ D.T)
    return tables


@dataclass(frozen=True, eq=False)
class Frame:
    """Coordinates of b triangles.

    Attributes
    ----------
    corner : ndarray (b, 2)
        Corner 0, lengths.
    edges : ndarray (b, 2, 2)
        The edges from there to corners 1 and 2, columns: x = corner + edges (a, b).
    size : ndarray (b,)
        Half the extent along the axes, lengths.
    centre : ndarray (b, 2)
        Its middle.
    """

    corner: Array
    edges: Array
    size: Array
    centre: Array

    def __getitem__(self, at: Index | slice) -> Frame:
        """Those of some of the triangles."""
        return Frame(self.corner[at], self.edges[at], self.size[at], self.centre[at])

    def local(self, x: Array) -> Array:
        """(a, b), (b, q, 2), of points `x` (b, q, 2)."""
        away = (x - self.corner[:, None]).transpose(0, 2, 1)
        return np.asarray(np.linalg.solve(self.edges, away).transpose(0, 2, 1))

    def scaled(self, x: Array) -> Array:
        """Coordinates (b, q, 2) along the axes, up to 1 in size, of points `x` (b, q, 2)."""
        return np.asarray((x - self.centre[:, None]) / self.size[:, None, None])


def frame_of(corners: Array) -> Frame:
    """The frame of triangles `corners` (b, 3, 2)."""
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
    centre = (corners.max(axis=1) + corners.min(axis=1)) / 2
    return Frame(corners[:, 0], edges, np.ptp(corners, axis=1).max(axis=1) / 2, centre)


def stresses(
    degree: int, frame: Frame, x: Array, local: Array, axial: bool, on_axis: bool = False
) -> Array:
    """Basis (b, q, c, m) of the stresses of a degree.

    Their c components are xx, yy, xy or rr, zz, hoop, rz; coefficients have units of stress. About
    an axis (`axial`) the degree is that of T, and it vanishes `on_axis` if a side lies there.

    Parameters
    ----------
    x, local : ndarray (b, q, 2)
        Points, and their `Frame.local`, which may be (1, q, 2) where it is the same for all.
    """
    highest = degree + (2 if not axial else -1 if on_axis else 1)
    i, j = products(highest)
    if not axial:
        i, j = i[3:], j[3:]  # linear functions have no stress
    a, b = (legendre_table(highest, 2 * local[..., c] - 1) for c in (0, 1))
    G = 2 * frame.size[:, None, None] * np.linalg.inv(frame.edges)  # by lengths of `size`

    def derivative(*by: int) -> Array:
        """Along the axes `by`."""
        total = np.zeros(())
        for along in np.ndindex(*(2,) * len(by)):
            n = sum(along)
            values = a[len(by) - n][..., i] * b[n][..., j]
            factor = np.prod([G[:, c, axis] for c, axis in zip(along, by, strict=True)], axis=0)
            total = total + factor[:, None, None] * values
        return np.asarray(total)

    if not axial:
        return np.stack([derivative(1, 1), derivative(0, 0), -derivative(0, 1)], axis=2)
    r = x[..., :1] / frame.size[:, None, None]
    f = np.broadcast_to(a[0][..., i] * b[0][..., j], (*x.shape[:2], len(i)))
    f_r, f_z, f_zz, none = derivative(0), derivative(1), derivative(1, 1), np.zeros_like(f)
    if on_axis:  # T_rr = r f, chi = r^2 f
        free = np.stack([f, none, f + r * f_r, none], axis=2)
        bent = np.stack([none, -(2 * f + r * f_r), r**2 * f_zz, r * f_z], axis=2)
    else:
        lower = i + j <= degree
        free = np.stack([f / r, none, f_r, none], axis=2)[..., lower]
        bent = np.stack([none, -f_r / r, f_zz, f_z / r], axis=2)[..., 1:]
    return np.concatenate([free, bent], axis=-1)


def projected(degree: int, frame: Frame, x: Array, weight: Array, values: Array) -> Array:
    """Coefficients (b, m, d) of the nearest polynomials of a degree to `values` (b, q, d).

    At quadrature points `x` (b, q, 2) with `weight` (b, q).
    """
    P = scalars(degree, frame, x)
    root = np.sqrt(weight)[..., None]
    basis, R = np.linalg.qr(root * P)
    return np.asarray(np.linalg.solve(R, basis.transpose(0, 2, 1) @ (root * values)))


def scalars(degree: int, frame: Frame, x: Array) -> Array:
    """The polynomials (b, q, m) themselves."""
    X = frame.scaled(x)
    a, b = (legendre.legvander(X[..., c], degree) for c in (0, 1))
    i, j = products(degree)
    return np.asarray(a[..., i] * b[..., j])


def balancing(degree: int, frame: Frame, x: Array, force: Array, axial: bool) -> Array:
    """Stress (b, q, c) at `x` (b, q, 2) whose divergence is minus a polynomial force.

    `force` (b, m, 2) are its coefficients as of `projected`, for a `degree`. About an axis only the
    axial part counts: s_zz = - int F_z dz.
    """
    X = frame.scaled(x)
    i, j = products(degree)
    a, b = (legendre.legvander(X[..., c], degree) for c in (0, 1))
    up = np.zeros((degree + 1, degree + 2))  # integrals of Legendre's polynomials
    up[0, 1] = 1.0
    for n in range(1, degree + 1):
        up[n, n + 1], up[n, n - 1] = 1 / (2 * n + 1), -1 / (2 * n + 1)
    ia, ib = (legendre.legvander(X[..., c], degree + 1) @ up.T for c in (0, 1))
    along_x = np.einsum("bqm,bm->bq", ia[..., i] * b[..., j], force[..., 0])
    along_y = np.einsum("bqm,bm->bq", a[..., i] * ib[..., j], force[..., 1])
    none = np.zeros_like(along_x)
    parts = [none, along_y, none, none] if axial else [along_x, along_y, none]
    return -np.stack(parts, axis=2) * frame.size[:, None, None]
