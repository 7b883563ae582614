"""The equilibrated stress as a user reads it: polynomials in equilibrium, and p*."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import ngsolve as ng
import numpy as np
import pytest
from numpy.polynomial import legendre

from drivers import check_certificate
from drivers.reference import axisymmetric_cases, cases
from ngcontact import Contact, Elastic, Hooke, solve
from tests.discrete.test_equilibrium import loose
from tests.estimator.bound.test_exact import settled
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
    """Cylinders under an axial load and a radial force that vary."""
    return replace(
        axisymmetric_cases.pressed_cylinders(inner),
        displacement={"bottom": (0, 0)},
        traction={"top": (0, -0.01 * (1 + ng.x))},
        force={"upper|lower": (0.01 * ng.x * ng.y, -0.005)},
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


@pytest.fixture(params=SCENES)
def certified(request, tmp_path):
    """A scene, its certificate as the driver reads it, and the places of the lattice (n, q, 2)."""
    solution = solved(request.param)
    settled(solution)
    path = solution.equilibrated.save(tmp_path / "certificate.npz")
    assert check_certificate.check(path)  # divergence, continuity, p* on both bodies, signs, B
    with np.load(path) as file:
        found = check_certificate.Certificate(dict(file))
    places = found.corners[:, :1] + found.a["lattice"] @ np.swapaxes(found.edges, 1, 2)
    return solution, found, places


def forces(solution, x):
    """F (n, q, 2) of the problem at places (n, q, 2) of the triangles of the stress."""
    found, mesh = np.zeros(x.shape), solution.mesh
    body = np.array([e.index for e in mesh.Elements()])[solution.equilibrated.element]
    for name, f in solution.problem.force.items():
        at = np.array(list(mesh.Materials(name).Mask()), dtype=bool)[body]
        found[at] = np.asarray(ng.CF(f)(mesh(*x[at].reshape(-1, 2).T))).reshape(found[at].shape)
    return found


def test_the_certificate_is_of_the_stress_and_of_the_forces(certified):
    solution, found, x = certified
    stress, mesh = solution.equilibrated, solution.mesh
    numbers = mesh.ngmesh.Elements2D().NumPy()["nodes"][:, :3].astype(int) - 1
    a, b, c = np.array(mesh.ngmesh.Coordinates())[numbers][stress.element][:, :, :2].swapaxes(0, 1)
    edges = np.stack([a - c, b - c], axis=-1)
    reference = np.linalg.solve(edges[:, None], (x - c[:, None])[..., None])[..., 0]
    element = np.repeat(stress.element, x.shape[1])
    s = stress.values(element, reference.reshape(-1, 2)).reshape(*x.shape[:2], -1)
    F, measure = forces(solution, x), 2 * np.pi * x[..., :1] if found.axial else 1.0
    size = ROUND_OFF * found.largest
    assert np.abs(measure * s[..., [0, 1, -1]] - found.a["stress"]).max() <= size
    length = np.abs(found.edges).max(axis=(1, 2))[:, None, None]
    own = slice(int(found.axial), None)  # the radial force is in the hoop stress
    assert np.abs(length * (measure * F - found.a["force"]))[..., own].max() <= size
    if found.axial:
        _, divergence = found.at(np.arange(len(x)), found.a["lattice"])
        hoop = divergence[..., 0] + measure[..., 0] * F[..., 0]
        assert np.abs(length[..., 0] * (2 * np.pi * s[..., 2] - hoop)).max() <= size


@pytest.mark.parametrize("certified", ["opening-1", "weighted-2", "weighted-3"], indirect=True)
def test_the_certificate_is_of_the_tractions(certified):
    """On half of the top and on a side; none on what is free."""
    solution, found, _ = certified
    a, t = found.a, np.linspace(0, 1, 5)
    start, stop = a["vertices"][a["side_vertices"]].swapaxes(0, 1)
    x = start[:, None] + t[:, None] * (stop - start)[:, None]
    told = a["side_traction"] @ legendre.legvander(2 * t - 1, a["side_traction"].shape[2] - 1).T
    expected, varied = np.zeros(x.shape), bool(solution.problem.force)
    low, high = x.min(axis=1), x.max(axis=1)
    pressed, right = (low[:, 1] == 1) & (high[:, 0] <= 1), (low[:, 0] == 2) & (low[:, 1] >= 0)
    expected[pressed] = (0, -1) + varied * x[pressed, :, :1] * (0.1, -1)
    expected[right] = (0, 0.2 * varied)
    expected *= np.linalg.norm(stop - start, axis=1)[:, None, None]
    free = ~a["side_held"]  # by component
    assert free.any()
    off = np.abs(told.swapaxes(1, 2) - expected)
    assert off[np.broadcast_to(free[:, None], off.shape)].max() <= ROUND_OFF * found.largest


@pytest.mark.parametrize(("order", "maxh"), [(1, 0.5), (2, 0.5), (3, 0.5), (2, 0.3)])
@pytest.mark.study(witness=["2-0.5"])
def test_a_pin_that_may_turn(order, maxh):
    """No pressure along the normals does work on its rotation, nor loads but for round-off."""
    pair = Contact("outer_contact", "inner_contact")
    problem = replace(loose((0, 0)), traction={"hole": (0, -1.0)}, contact=[pair])
    solution = solve(problem, maxh=maxh, order=order)
    settled(solution)
    assert solution.error_bound < 2 * solution.error_estimate
