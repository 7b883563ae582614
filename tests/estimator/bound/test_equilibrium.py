"""The equilibrated stress as a user reads it: polynomials in equilibrium, and p*."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import axisymmetric_cases, cases
from ngcontact import Contact, Elastic, Hooke, Problem, solve
from ngcontact.geometries import rings
from ngcontact.geometries.region import body, compound, polygon
from ngcontact.lagrange import gauss
from tests.estimator.bound.test_exact import RESIDUAL, settled
from tests.scenes import unmatched_blocks

LAW = Elastic(E=1.0, nu=0.3)
# Of polynomials through values, and of their derivatives, relative to stresses; measured 2e-10.
ROUND_OFF = 1e-8


def opening(**changes):
    """A block on a clamped one, pressed on half of its top."""
    return replace(cases.partly_opening_block(), **changes)


def weighted(**changes):
    """The same under loads that are polynomials of the degree of its stress."""
    force = {"upper": (0.3, -0.2 * ng.x), "lower": (0.1 * ng.y, -0.5)}
    traction = {"pressed": (0.1 * ng.x, -1.0 - ng.x), "upper_right": (0.0, 0.2)}
    return opening(force=force, traction=traction, **changes)


def about_an_axis(inner):
    """Cylinders under an axial load that varies."""
    return Problem(
        geometry=axisymmetric_cases.cylinders(inner),
        materials=cases.BLOCKS,
        displacement={"bottom": (0, 0)},
        traction={"top": (0, -0.01 * (1 + ng.x))},
        contact=[Contact("upper_contact", "lower_contact")],
        model="axisymmetric",
    )


SCENES = {
    "opening-1": (opening, 1),
    "weighted-2": (weighted, 2),
    "weighted-3": (weighted, 3),
    "anisotropic-2": (
        lambda: weighted(materials={"upper|lower": Hooke([[9, 2, 1], [2, 4, 1], [1, 1, 3]])}),
        2,
    ),
    "dual rows-2": (
        lambda: replace(cases.one_transition().problem, geometry=unmatched_blocks()),
        2,
    ),
    "Hertz-4": (lambda: cases.hertz_contact(half_width=0.5).problem, 4),
    "ring of large radius-2": (lambda: about_an_axis(0.5), 2),
    "on the axis-2": (lambda: about_an_axis(0.0), 2),
}


@cache
def solved(name):
    make, order = SCENES[name]
    return solve(make(), maxh=0.5, order=order)


def powers(degree, x):
    """Monomials (n, q, m) and their derivatives by x and y, at points (n, q, 2)."""
    i, j = np.array([(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]).T
    X, Y = x[..., :1], x[..., 1:]
    by_x = i * X ** np.maximum(i - 1, 0) * Y**j
    by_y = j * X**i * Y ** np.maximum(j - 1, 0)
    return X**i * Y**j, by_x, by_y


class Polynomials:
    """The stress on all triangles (times r about an axis) through values at points inside."""

    def __init__(self, solution):
        found, mesh = solution.equilibrated, solution.mesh
        self.axial = solution.problem.model == "axisymmetric"
        self.x, self.degree = found.triangles, found.degree
        numbers = mesh.ngmesh.Elements2D().NumPy()["nodes"][:, :3].astype(int) - 1
        corners = np.array(mesh.ngmesh.Coordinates())[numbers][found.element][:, :, :2]
        self.middle = self.x.mean(axis=1, keepdims=True)
        self.size = np.ptp(self.x, axis=1).max(axis=1)[:, None, None]
        n = self.degree + 3
        shares = np.array([(i, j, n - i - j) for i in range(1, n) for j in range(1, n - i)]) / n
        x = shares @ self.x
        edges = np.stack([corners[:, 0] - corners[:, 2], corners[:, 1] - corners[:, 2]], axis=-1)
        reference = np.linalg.solve(edges[:, None], (x - corners[:, None, 2])[..., None])[..., 0]
        element = np.repeat(found.element, len(shares))
        values = found.values(element, reference.reshape(-1, 2)).reshape(*x.shape[:2], -1)
        if self.axial:
            values = values * x[..., :1]
        self.largest = np.abs(values).max()
        P = powers(self.degree, self.local(x))[0]
        self.c = np.linalg.pinv(P) @ values
        off = np.abs(P @ self.c - values).max()
        assert off <= ROUND_OFF * self.largest  # polynomials of that degree they are

    def local(self, x):
        return (x - self.middle) / self.size

    def __call__(self, x):
        """Components (n, q, c) and their derivatives by x and y, at points (n, q, 2)."""
        values, by_x, by_y = powers(self.degree, self.local(x))
        return values @ self.c, by_x @ self.c / self.size, by_y @ self.c / self.size


@pytest.mark.parametrize("name", SCENES)
def test_the_divergence_balances_the_force(name):
    solution = solved(name)
    settled(solution)
    s = Polynomials(solution)
    x = np.random.default_rng(0).dirichlet(np.ones(3), 5) @ s.x
    values, dx, dy = s(x)
    hoop = values[..., 2] / x[..., 0] if s.axial else 0.0  # of T = r s
    div = np.stack([dx[..., 0] + dy[..., -1] - hoop, dx[..., -1] + dy[..., 1]], axis=-1)
    force, mesh = np.zeros_like(div), solution.mesh
    owner = np.array([e.mat for e in mesh.Elements()])[solution.equilibrated.element]
    for name, f in solution.problem.force.items():
        at = owner == name
        points = mesh(*x[at].reshape(-1, 2).T)
        force[at] = np.asarray(ng.CF(f)(points)).reshape(force[at].shape)
    off = np.abs(div + force) * s.size
    assert off.max() <= ROUND_OFF * s.largest


def sides_of(s):
    """For every side of a triangle: points on it and what s n is there, by its two ends."""
    found = {}
    t = np.linspace(0.1, 0.9, 6)
    for i in range(3):
        a, b = s.x[:, (i + 1) % 3], s.x[:, (i + 2) % 3]
        x = a[:, None] + t[:, None] * (b - a)[:, None]
        values = s(x)[0]
        n = np.column_stack([b[:, 1] - a[:, 1], a[:, 0] - b[:, 0]])
        n = n / np.linalg.norm(n, axis=1, keepdims=True)
        tx = values[..., 0] * n[:, :1] + values[..., -1] * n[:, 1:]
        ty = values[..., -1] * n[:, :1] + values[..., 1] * n[:, 1:]
        for k in range(len(a)):
            first, last = (tuple(np.round(z, 9)) for z in (a[k], b[k]))
            ahead = first < last
            force = np.column_stack([tx[k], ty[k]])
            key = (first, last) if ahead else (last, first)
            order = slice(None) if ahead else slice(None, None, -1)
            found.setdefault(key, []).append((x[k, order], force[order], n[k]))
    return found


@pytest.mark.parametrize("name", SCENES)
def test_tractions_are_continuous(name):
    """What one triangle exerts the other has; of two bodies that touch, in contact and beside."""
    s = Polynomials(solved(name))
    pairs = [both for both in sides_of(s).values() if len(both) == 2]
    assert len(pairs) > 10
    for (_, one, _), (_, other, _) in pairs:
        assert np.abs(one + other).max() <= ROUND_OFF * s.largest


@pytest.mark.parametrize("name", ["opening-1", "weighted-2", "weighted-3", "anisotropic-2"])
def test_tractions_are_those_given(name):
    """On half of the top and on a side; none on what is free, no shear on guides."""
    s, seen = Polynomials(solved(name)), 0
    for both in sides_of(s).values():
        x, force, _ = both[0]
        expected, own = np.zeros_like(force), slice(0, 2)
        if len(both) == 2 or np.allclose(x[:, 1], -1):  # in a body, or held
            continue
        if np.allclose(x[:, 1], 1) and x[:, 0].max() < 1:
            expected[:, 1] = -1.0
            if name != "opening-1":
                expected += np.column_stack([0.1 * x[:, 0], -x[:, 0]])
        elif np.allclose(x[:, 0], 2) and x[:, 1].min() > 0 and name != "opening-1":
            expected[:, 1] = 0.2
        elif np.allclose(x[:, 0], 0):
            own = slice(1, 2)
        assert np.abs(force - expected)[:, own].max() <= ROUND_OFF * s.largest
        seen += 1
    assert seen > 5


def test_a_function_of_elements_and_places():
    """Its distance to sigma_h is the constitutive part."""
    solution = solved("weighted-2")
    mesh, found = solution.mesh, solution.equilibrated
    t, w = gauss(60)
    a, b = (z.ravel() for z in np.meshgrid(t, t))
    reference = np.column_stack([a * (1 - b), a * b])
    weight = np.outer(w, w).ravel() * a
    rule = ng.IntegrationRule([(*place, 0.0) for place in reference.tolist()], weight.tolist())
    points = mesh.MapToAllElements(rule, ng.VOL)
    det = np.abs(ng.Det(ng.specialcf.JacobianMatrix(2))(points)).ravel()
    element = np.repeat(np.arange(mesh.ne), len(weight))
    s = found.values(element, np.tile(reference, (mesh.ne, 1)))
    own = solution.stress(points)[:, [0, 3, 1]]
    law = solution.problem.materials["upper|lower"]
    C = np.array(law.voigt("plane strain")(mesh(0.5, 0.5))).reshape(3, 3)
    energy = np.einsum("ki,ij,kj->k", s - own, np.linalg.inv(C), s - own)
    total = (energy * det * np.tile(weight, mesh.ne)).sum()
    # Elements that are divided are integrated as one: measured 1e-4.
    assert total == pytest.approx(solution.bound_parts["constitutive"], rel=1e-2)


def resultant(solution, pair=0):
    """Of p* on straight lines."""
    trace = solution.discrete.space.trace
    p = solution.equilibrated.pressure[pair]
    length = np.linalg.norm(np.diff(trace.curve[p.segments][:, [0, -1]], axis=1)[:, 0], axis=1)
    return float((length * np.abs(np.diff(p.span, axis=1))[:, 0]) @ p.coefficients.mean(axis=1))


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("rows", ["nodal", "dual"])
def test_a_body_that_contact_alone_holds(rows, order):
    """P* balances the load exactly, and is nowhere negative."""
    pair = Contact("upper_contact", "lower_contact", rows=rows)
    problem = opening(sliding="lower_axis", traction={"pressed|top": 1.0}, contact=[pair])
    solution = solve(problem, maxh=0.4, order=order)
    settled(solution)
    assert resultant(solution) == pytest.approx(2.0, rel=1e-9)
    assert solution.equilibrated.pressure[0].coefficients.min() >= 0


@pytest.mark.parametrize(("order", "maxh"), [(1, 0.5), (2, 0.5), (3, 0.5), (2, 0.3)])
@pytest.mark.study(witness=["2-0.5"])
def test_a_pin_that_may_turn(order, maxh):
    """No pressure along the normals does work on its rotation, nor loads but for round-off."""
    problem = Problem(
        geometry=rings(0.5, 1.0, 2.0, interference=-1e-2),
        materials={"inner|outer": LAW},
        displacement={"rim": (0, 0)},
        traction={"hole": (0, -1e-3)},
        contact=[Contact("outer_contact", "inner_contact")],
    )
    solution = solve(problem, maxh=maxh, order=order)
    settled(solution)
    assert solution.error_bound < 2 * solution.error_estimate


def test_an_excentric_load_on_a_disc_that_may_turn():
    problem = Problem(
        geometry=rings(0.5, 1.0, 2.0, interference=1e-3),
        materials={"inner|outer": LAW},
        displacement={"rim": (0, 0)},
        force={"inner": (-1e-4, -1e-3)},
        contact=[Contact("inner_contact", "outer_contact")],
    )
    solution = solve(problem, maxh=0.4, order=1)
    settled(solution)
    assert solution.error_bound < 2 * solution.error_estimate


def on_a_wide_block(left, right):
    """A block from x = `left` to `right`, pressed on one from -1 to 1."""
    upper = [(left, 0), (right, 0), (right, 0.5), (left, 0.5)]
    lower = [(-1, -0.7), (1, -0.7), (1, 0), (-1, 0)]
    return compound(
        body("upper", polygon(upper, ["foot", "side", "top", "side"])),
        body("lower", polygon(lower, ["bottom", "wall", "seat", "wall"])),
    )


@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize("right", [0.42, 0.02, 1e-3])
def test_sides_beside_vertices(right, order):
    """An edge lies next to a vertex of the other body: triangles are thin, the stress is one."""
    problem = Problem(
        geometry=on_a_wide_block(-0.37, right),
        materials={"upper|lower": LAW},
        displacement={"bottom": (0, 0), "top": (0, -1e-3)},
        contact=[Contact("foot", "seat", rows="dual")],
    )
    solution = solve(problem, maxh=0.5, order=order)
    settled(solution)
    assert solution.equilibrated.certificate["tractions"] <= RESIDUAL
