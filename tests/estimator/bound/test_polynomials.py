"""Stresses on a triangle: in equilibrium, with as many tractions as there can be."""

from __future__ import annotations

import numpy as np
import pytest

from ngcontact.estimator.bound.elements import traces
from ngcontact.estimator.bound.polynomials import (
    balancing,
    coordinates,
    projected,
    scalars,
    stresses,
)
from ngcontact.lagrange import gauss, gauss_lobatto, lagrange_derivative

TRIANGLE = np.array([[[1.7, 0.2], [2.9, 0.5], [2.1, 1.6]]])
ON_AXIS = np.array([[[1.3, 0.4], [0.0, 1.1], [0.0, -0.2]]])
THIN = np.array([[[1.0, 0.0], [3.0, 0.0], [2.2, 1e-2]]])
ROUND_OFF = 1e-11  # of derivatives of degree 6, relative to stresses; measured 3e-13
KINDS = {
    "plane": (TRIANGLE, False, False),
    "thin": (THIN, False, False),
    "about an axis": (TRIANGLE, True, False),
    "on the axis": (ON_AXIS, True, True),
}


def height(corners):
    """The least one of a triangle, nearly."""
    edges = corners[0, 1:] - corners[0, 0]
    return np.abs(np.linalg.det(edges)) / np.linalg.norm(edges, axis=1).max()


def derivative(function, x, axis, degree, size):
    """Of a polynomial of a degree, at points `x` (q, 2): through points on lines; exact."""
    t = size * (gauss_lobatto(degree) - 0.5)
    away = np.zeros((len(t), 2))
    away[:, axis] = t
    values = function((x[:, None] + away).reshape(1, -1, 2))[0]
    rows = lagrange_derivative(degree, np.array([0.5]))[0] / size
    return np.einsum("t,qt...->q...", rows, values.reshape(len(x), len(t), *values.shape[1:]))


def inside(corners, count=7):
    """Points (q, 2) of a triangle."""
    shares = np.random.default_rng(1).dirichlet(np.ones(3), count)
    return shares @ corners[0]


def divergence(function, x, axial, degree, size=1.0):
    """Of a stress (1, q, c, ...), at points (q, 2), times r about an axis."""

    def times(y):
        return function(y) * (y[..., :1, None] if axial else 1.0)

    dx, dy = (derivative(times, x, axis, degree, size) for axis in (0, 1))
    hoop = function(x[None])[0][:, 2] if axial else 0.0
    return np.stack([dx[:, 0] + dy[:, -1] - hoop, dx[:, -1] + dy[:, 1]])


@pytest.mark.parametrize("degree", [2, 4, 6])
@pytest.mark.parametrize("kind", KINDS)
def test_stresses_without_a_divergence(kind, degree):
    corners, axial, on_axis = KINDS[kind]
    x = inside(corners)

    def basis(y):
        return stresses(degree, corners, coordinates(corners, y), axial, on_axis)

    values = basis(x[None])[0]
    size = height(corners)
    div = size * divergence(basis, x, axial, degree + 2, size)
    assert np.abs(div).max() <= ROUND_OFF * np.abs(values).max()
    # As many as there are polynomials less conditions: none depends on others.
    k = degree
    plane = (k + 3) * (k + 4) // 2 - 3
    count = {"about an axis": (k + 1) * (k + 2) // 2 + (k + 2) * (k + 3) // 2 - 1}
    count["on the axis"] = k * (k + 1)
    assert values.shape[-1] == count.get(kind, plane)
    many = basis(inside(corners, 200)[None])[0].reshape(-1, values.shape[-1])
    assert np.linalg.matrix_rank(many / np.linalg.norm(many, axis=0)) == values.shape[-1]


def tractions_of(degree, corners, axial):
    """Moments (m, 6 (degree + 1)) of tractions on the sides: x, y on each in turn."""
    t, w = gauss(2 * degree + 4)
    found = []
    for i in range(3):
        a, b = corners[0, (i + 1) % 3], corners[0, (i + 2) % 3]
        x = (a + t[:, None] * (b - a))[None]
        T = stresses(degree, corners, coordinates(corners, x), axial)[0]
        nx, ny = b[1] - a[1], a[0] - b[0]
        chi = (w * (x[0, :, 0] if axial else 1.0))[:, None] * traces(degree, t)
        found.append(np.einsum("qm,qc->mc", T[:, 0] * nx + T[:, -1] * ny, chi))
        found.append(np.einsum("qm,qc->mc", T[:, -1] * nx + T[:, 1] * ny, chi))
    return np.concatenate(found, axis=1)


@pytest.mark.parametrize("degree", [2, 3, 5])
@pytest.mark.parametrize(("axial", "less"), [(False, 6), (True, 4)])
def test_tractions_but_for_rigid_motions_and_corners(axial, less, degree):
    """Three motions in the plane, one along an axis; three corners where n.(s m) = m.(s n)."""
    N = tractions_of(degree, TRIANGLE, axial)
    assert np.linalg.matrix_rank(N, tol=1e-9 * np.abs(N).max()) == 6 * (degree + 1) - less


def test_the_condition_at_a_corner():
    """Tractions of each stress at a corner fulfil n.(s m) = m.(s n)."""
    degree = 3
    N = tractions_of(degree, TRIANGLE, False).reshape(-1, 3, 2, degree + 1)
    x = TRIANGLE[0]
    sides = np.roll(x, -2, axis=0) - np.roll(x, -1, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    n = np.column_stack([sides[:, 1], -sides[:, 0]])  # times lengths, as the moments
    # At corner 0 side 1 ends and side 2 begins.
    first, last = traces(degree, np.array([0.0, 1.0]))
    at_end = N[:, 1] @ last, N[:, 2] @ first
    left, right = at_end[0] @ n[2], at_end[1] @ n[1]
    assert np.abs(left - right).max() <= ROUND_OFF * np.abs(N).max() * lengths.max()
    s = stresses(degree, TRIANGLE, coordinates(TRIANGLE, x[None, :1]), False)[0, 0]
    sn = s[0] * n[1, 0] + s[2] * n[1, 1]
    np.testing.assert_allclose(at_end[0][:, 0], sn, atol=ROUND_OFF * np.abs(s).max())


@pytest.mark.parametrize("axial", [False, True])
def test_what_balances_a_force(axial):
    """Minus its divergence is a polynomial force of that degree; about an axis the axial one."""
    degree = 3
    t, w = gauss(10)
    a, b = (z.ravel() for z in np.meshgrid(t, t))
    shares = np.column_stack([(1 - a), a * (1 - b), a * b])  # Duffy's
    x, weight = (shares @ TRIANGLE[0])[None], (np.outer(w, w).ravel() * a)[None]

    def force(x):
        r, z = x[..., 0], x[..., 1]
        return np.stack([r**3 - 2 * r * z, 1 + z**3 - r**2], axis=-1)

    c = projected(scalars(degree, TRIANGLE, x), weight, force(x))
    at = inside(TRIANGLE)
    found = (scalars(degree, TRIANGLE, at[None]) @ c)[0]
    np.testing.assert_allclose(found, force(at), rtol=1e-11)

    def stress(y):
        return balancing(degree, TRIANGLE, y, c, axial)[..., None]

    div = divergence(stress, at, axial, degree + 3)[..., 0]
    expected = -force(at).T * (at[:, 0] if axial else 1.0)
    np.testing.assert_allclose(div[axial:], expected[axial:], rtol=1e-10)
