"""Stresses without tractions that balance forces, on a triangle and on its parts."""

from __future__ import annotations

import ngsolve as ng
import numpy as np
import pytest

from ngcontact import solve
from ngcontact.estimator.bound.oscillation import Division, Remainders
from ngcontact.estimator.bound.polynomials import CORNERS, derivatives
from ngcontact.estimator.bound.traction_free import (
    balancing_stress,
    basis,
    composite,
    fit,
    free_stress,
    parts,
    restriction,
)
from tests.quadrature.test_loads import loaded

ROUND_OFF = 1e-11
KINDS = [(1, 4, 6), (1, 7, 9), (4, 3, 5)]


def divergence(degree, x, t):
    """Of stresses with coefficients `t` (..., m, 3) at (q, 2) points."""
    by = 2 * derivatives(degree, x, [(1, 0), (0, 1)])
    a, b = by[:, 0] @ t, by[:, 1] @ t
    return np.stack([a[..., 0] + b[..., 2], a[..., 2] + b[..., 1]], axis=-1)


def tractions(degree, x, normal, t):
    s = basis(degree, x) @ t
    return s[..., [0, 2]] * normal[0] + s[..., [2, 1]] * normal[1]


def on_sides(n):
    """By their middles: the part, points in it and a normal, of each side of n^2 parts."""
    found = {}
    u = np.linspace(0.05, 0.95, 12)[:, None]
    for i, (origin, scale) in enumerate(zip(*parts(n), strict=True)):
        for j in range(3):
            a, b = CORNERS[j - 2], CORNERS[j - 1]
            x, normal = a + u * (b - a), scale * np.array([(b - a)[1], -(b - a)[0]])
            x = x[:: int(np.sign(scale))]  # in one sense on both parts
            middle = tuple(np.round(2 * n * (origin + scale * (a + b) / 2)).astype(int))
            found.setdefault(middle, []).append((i, x, normal))
    return found


@pytest.mark.parametrize(("n", "force", "degree"), KINDS)
def test_they_balance_all_forces_without_resultants(n, force, degree):
    (origin, scale), (x, w) = parts(n), composite(0, 2 * degree)
    place = origin[:, None] + scale[:, None, None] * x
    f = basis(force, x) @ np.random.default_rng(0).standard_normal(
        (n**2, basis(force, x).shape[1], 2)
    )
    rigid = np.zeros((*place.shape, 3))
    rigid[..., 0, 0] = rigid[..., 1, 1] = 1.0
    rigid[..., 2] = np.stack([-place[..., 1], place[..., 0]], axis=-1)
    mass = np.einsum("pqcr,q,pqcs->rs", rigid, w, rigid)
    f -= rigid @ np.linalg.solve(mass, np.einsum("pqcr,q,pqc->r", rigid, w, f))
    c = fit(force, 0, 2 * degree) @ f
    t = np.einsum("pkvjlc,jlc->pkv", balancing_stress(n, force, degree), c)
    off = divergence(degree, x, t) / scale[:, None, None] + f
    assert np.abs(off).max() <= ROUND_OFF * np.abs(f).max()
    sides = on_sides(n)
    assert len(sides) == 3 * n * (n + 1) // 2
    for both in sides.values():
        total = sum(tractions(degree, x, normal, t[i]) for i, x, normal in both)
        assert np.abs(total).max() <= ROUND_OFF * np.abs(t).max()


@pytest.mark.parametrize("degree", [6, 9])
def test_free_stresses(degree):
    """Airy's functions (1 - a - b)^2 a^2 b^2 q, as many as there are q."""
    t = np.moveaxis(free_stress(degree), 2, 0)
    left = degree + 2 - 6
    assert len(t) == (left + 1) * (left + 2) // 2
    assert np.linalg.matrix_rank(t.reshape(len(t), -1), tol=1e-6) == len(t)
    x, _ = composite(0, 2 * degree)
    assert np.abs(divergence(degree, x, t)).max() <= ROUND_OFF * np.abs(t).max() * degree**2
    for ((_, x, normal),) in on_sides(1).values():
        assert np.abs(tractions(degree, x, normal, t)).max() <= ROUND_OFF * np.abs(t).max()


@pytest.mark.parametrize("own", [Division(1, 6, 4, 10), Division(4, 5, 3, 6)])
def test_stresses_of_triangles_balance_more_of_the_force(own):
    """On each part -div (s + t) is what is balanced; on sides of the triangles t does nothing."""
    force = ng.CF((ng.exp(3 * ng.x * ng.y), ng.IfPos(ng.x - 0.3, ng.sin(5 * ng.x), 0.0)))
    problem = loaded(force={"body": force})
    solution = solve(problem, maxh=0.4, order=1)
    proof = solution.equilibrated.proof
    cells, (e,) = proof.dual.cells, proof.dual.elements
    at, m = e.places.at[e.depth == (own.n > 1)], own.degree
    assert len(at) >= 3
    unit = np.ones(len(cells.triangles))
    view = Remainders(problem, cells, solution.displacement, e, proof.stress.s, unit)
    whole = view.whole(at, m)
    part, missed = view.balanced(whole, own, 0)
    (x, _), into = composite(0, 2 * m), np.linalg.inv(part.edges(cells))[:, None]
    by_a, by_b = np.moveaxis(2 * derivatives(m, x, [(1, 0), (0, 1)]), 1, 0)
    by = np.stack([by_a @ part.stress, by_b @ part.stress], axis=-1) @ into
    div = np.stack([by[..., 0, 0] + by[..., 2, 1], by[..., 2, 0] + by[..., 1, 1]], axis=-1)
    f = basis(m, x) @ part.force
    assert np.abs(div + f).max() <= 1e-10 * np.abs(f).max()
    places = part.places(cells, *composite(0, own.order))
    rest = places.evaluate(cells, force) - basis(m, composite(0, own.order)[0]) @ part.force
    assert np.allclose(missed**2, (places.weight * (rest**2).sum(axis=2)).sum(axis=1))
    for sides in on_sides(own.n).values():
        for i, y, normal in sides if len(sides) == 1 else ():
            mine = part.some(np.arange(i, len(part.at), own.n**2))
            E = mine.edges(cells)
            n = normal @ np.linalg.inv(E)
            at = mine.origin[:, None] + mine.scale[:, None, None] * y
            s, old = (
                basis(m, y) @ mine.stress,
                np.einsum("nqm,nmv->nqv", basis(m, at), whole.stress),
            )
            t = s - old
            pull = np.stack(
                [
                    t[..., 0] * n[:, :1] + t[..., 2] * n[:, 1:],
                    t[..., 2] * n[:, :1] + t[..., 1] * n[:, 1:],
                ]
            )
            assert np.abs(pull).max() <= 1e-10 * np.abs(s).max() * np.abs(n).max()


def test_polynomials_on_parts():
    c = np.random.default_rng(1).standard_normal((15, 2))
    x, w = composite(1, 8)
    assert w.sum() == pytest.approx(0.5, rel=1e-14)
    own, _ = composite(0, 8)
    assert np.allclose(basis(4, x).reshape(16, -1, 15) @ c, basis(4, own) @ (restriction(4, 4) @ c))
    assert np.allclose(fit(4, 1, 8) @ basis(4, x), np.eye(15))
