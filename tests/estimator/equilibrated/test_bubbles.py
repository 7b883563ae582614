"""Stresses inside one triangle that balance what polynomials of lower degree miss."""

from __future__ import annotations

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import solve
from ngcontact.estimator.equilibrated.data import (
    CORNERS,
    PART_DEGREE,
    basis,
    dimension,
    legendre_values,
    part_corners,
    triangle_rule,
)
from ngcontact.estimator.equilibrated.stresses import beside, inside, on_parts
from ngcontact.lagrange import gauss

V = 6  # degree of the displacements that stresses are tested with
ROUND_OFF = 1e-11  # measured 1e-14 at degree 6 and, by the kernels of BLAS, up to 1.1e-12 at 9


def strain_products(t, corners):
    """Means of `t` (..., p, 3, n) in parts (p, 3, 2) times gradients of displacements."""
    degree = next(k for k in range(1, 20) if dimension(k) == t.shape[-1])
    points, weights = triangle_rule(degree + V)
    hats = np.column_stack([points, 1 - points.sum(axis=1)])
    values = basis(degree).values(points)
    total = 0.0
    for i, part in enumerate(corners):
        gx, gy = basis(V).gradients(hats @ part)
        xx, yy, xy = np.moveaxis(t[..., i, :, :] @ values.T, -2, 0)
        both = xx @ (weights[:, None] * gx), xy @ (weights[:, None] * gx)
        more = xy @ (weights[:, None] * gy), yy @ (weights[:, None] * gy)
        total = total + np.stack([both[0] + more[0], both[1] + more[1]], axis=-2)
    return total / len(corners)


@pytest.mark.parametrize("low", [2, 3, 5])
def test_stresses_without_tractions_have_the_divergence(low):
    high = low + 4
    t = inside(low, high)
    points, weights = triangle_rule(high + V)
    force = basis(high - 1).values(points)[:, dimension(low - 1) :]
    work = (force * weights[:, None]).T @ basis(V).values(points)
    found = strain_products(t[:, :, None], CORNERS[None])
    for component in range(2):
        expected = np.zeros_like(found[component])
        expected[:, component] = -work
        assert np.abs(found[component] - expected).max() <= ROUND_OFF


@pytest.mark.parametrize("low", [2, 3, 5])
def test_stresses_without_divergence_have_the_tractions(low):
    high = low + 3
    corners = np.concatenate([CORNERS, [[1 / 3, 1 / 3]]])
    found = strain_products(beside(low, high), corners[[[0, 1, 3], [1, 2, 3], [2, 0, 3]]])
    s, w = gauss(high + V)
    places = CORNERS[0] + s[:, None] * (CORNERS[1] - CORNERS[0])
    work = (legendre_values(high, s)[:, low:] * w[:, None]).T @ basis(V).values(places)
    for component in range(2):
        expected = np.zeros_like(found[component])
        expected[:, component] = 2 * work  # the mean is over an area of 1/2
        assert np.abs(found[component] - expected).max() <= ROUND_OFF


def test_stresses_in_parts_have_the_divergence():
    corners, points = part_corners(), triangle_rule(PART_DEGREE + V)[0]
    weights = triangle_rule(PART_DEGREE + V)[1] / len(corners)
    hats, values = (
        np.column_stack([points, 1 - points.sum(axis=1)]),
        basis(PART_DEGREE).values(points),
    )
    places = (hats @ corners).reshape(-1, 2)
    # Forces on the parts that do no work on rigid motions.
    force = np.random.default_rng(0).normal(size=(len(corners), 2, values.shape[1]))
    at_points = np.einsum("pci,qi->pqc", force, values)
    linear = basis(1).values(places).reshape(*at_points.shape[:2], 3)
    moments = np.einsum("q,pqc,pqj->cj", weights, at_points, linear)
    at_points -= np.einsum("cj,pqj->pqc", moments, linear)
    force = np.einsum("q,qi,pqc->pci", weights * len(corners), values, at_points)
    found = strain_products(np.einsum("pci,pciqsn->qsn", force, on_parts()), corners)
    v = basis(V).values(places).reshape(*at_points.shape[:2], -1)
    work = np.einsum("q,pqc,pqi->ci", weights, at_points, v)
    assert np.abs(found + work).max() <= ROUND_OFF


def loaded(**loads):
    """Two blocks in bonded contact on top of each other, clamped below."""
    problem = cases.partly_opening_block()
    pair = replace(problem.contact[0], bilateral=True)
    return replace(problem, contact=[pair], **loads)


LOADS = {
    "body force": {"force": {"upper|lower": (ng.sin(9 * ng.x), ng.cos(7 * ng.y))}},
    "jumping body force": {"force": {"upper": (0, ng.IfPos(ng.x - 0.13, -1, 1))}},
    "traction": {"traction": {"pressed|top": (ng.sin(8 * ng.x), ng.cos(9 * ng.x))}},
}


@pytest.mark.parametrize("name", list(LOADS))
@pytest.mark.study(witness=["traction"])
def test_energies_with_loads_that_no_polynomial_meets(name):
    """Bounds of the energy on a fine mesh lie within those on a coarse one."""
    problem = loaded(**LOADS[name])
    coarse, fine = (solve(problem, maxh=h, order=2) for h in (0.7, 0.2))
    (low, high), (lower, upper) = coarse.energy_bounds, fine.energy_bounds
    assert low <= lower
    assert upper <= high
    assert upper - lower < (high - low) / 5
    assert 0 < coarse.bound_parts["loads"]
