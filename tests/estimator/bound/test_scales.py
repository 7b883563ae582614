"""Units and directions are the user's: the relative bound does not know them."""

from __future__ import annotations

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import axisymmetric_cases, cases
from ngcontact import Elastic, Hooke, Problem, solve
from tests.estimator.bound.test_exact import settled
from tests.given_meshes import two_blocks

SMALL, LARGE = 1e-9, 1e9


def softened(problem, scale):
    """Moduli, tractions and forces times `scale`."""
    times = lambda values: tuple(scale * ng.CF(v) for v in values)  # noqa: E731
    return replace(
        problem,
        materials={name: Elastic(law.E * scale, law.nu) for name, law in problem.materials.items()},
        traction={
            name: times(load) if isinstance(load, tuple) else scale * ng.CF(load)
            for name, load in problem.traction.items()
        },
    )


SCENES = {
    "Hertz": (lambda: cases.hertz_contact().problem, 2),
    "opening": (cases.partly_opening_block, 1),
    "shrink fit": (lambda: axisymmetric_cases.fitted_rings()[0], 2),
}


@pytest.mark.parametrize("scale", [SMALL, LARGE])
@pytest.mark.parametrize("scene", SCENES)
def test_moduli_and_loads(scene, scale):
    """B is the root of a modulus times a length squared, per thickness."""
    make, order = SCENES[scene]
    one, other = (solve(p, maxh=0.3, order=order) for p in (make(), softened(make(), scale)))
    settled(other)
    assert other.error_bound == pytest.approx(one.error_bound * np.sqrt(scale), rel=1e-6)
    for low, high in zip(one.energy_bounds, other.energy_bounds, strict=True):
        assert high == pytest.approx(scale * low, rel=1e-6)


def magnified(size, angle=0.0, law=None):
    """Two blocks of given meshes, one wider, pressed on each other; the upper one is tilted."""
    mesh = two_blocks(size * np.linspace(-1, 1, 6), size * np.linspace(-1, 1, 8))
    corner = np.array(mesh.ngmesh.Coordinates())
    c, s = np.cos(angle), np.sin(angle)
    for point, (x, y) in zip(mesh.ngmesh.Points(), corner[:, :2], strict=True):
        y *= size
        point[0], point[1] = c * x - s * y, s * x + c * y
    mesh.ngmesh.Update()
    along = (c * ng.x + s * ng.y) / size
    down = -0.02 * size - 0.01 * size * along
    base = cases.one_transition().problem
    return Problem(
        geometry=ng.Mesh(mesh.ngmesh),
        materials=base.materials if law is None else {"upper|lower": law},
        displacement={"bottom": (0, 0), "top": (-s * down, c * down)},
        contact=base.contact,
    )


@pytest.mark.parametrize(
    ("size", "angle", "order"), [(SMALL, 0, 2), (LARGE, 0, 2), (1, 0.3, 1), (1, 2.0, 3)]
)
def test_lengths_and_directions(size, angle, order):
    one, other = (solve(magnified(h, a), order=order) for h, a in ((1.0, 0.0), (size, angle)))
    settled(other)
    assert other.relative_error_bound == pytest.approx(one.relative_error_bound, rel=1e-6)
    assert other.error_bound == pytest.approx(size * one.error_bound, rel=1e-6)


def turned(C, angle):
    """A law of Voigt's components in axes that are turned."""
    c, s = np.cos(angle), np.sin(angle)
    T = np.array(
        [[c * c, s * s, -2 * s * c], [s * s, c * c, 2 * s * c], [s * c, -s * c, c * c - s * s]]
    )
    return Hooke((T @ C @ T.T).tolist())


def test_directions_of_an_anisotropic_law():
    C = np.array([[1e4, 20.0, 5.0], [20.0, 10.0, 1.0], [5.0, 1.0, 3.0]])
    one, other = (solve(magnified(1.0, a, turned(C, a)), order=2) for a in (0.0, 0.7))
    settled(other)
    assert other.relative_error_bound == pytest.approx(one.relative_error_bound, rel=1e-5)


@pytest.mark.parametrize("order", [1, 2])
def test_a_ring_of_large_radius_has_the_bound_of_the_plane(order):
    """To 1/100, radius over width; about an axis stresses are of one degree more."""

    def bound(model):
        problem = Problem(
            geometry=axisymmetric_cases.cylinders(99, 101),
            materials=cases.BLOCKS,
            displacement={"bottom": (0, 0), "top": (0, -0.02)},
            contact=[
                replace(
                    cases.one_transition().problem.contact[0],
                    direction=(0, -1),
                    gap=(ng.x - 100) ** 2 / 10,
                )
            ],
            model=model,
        )
        solution = solve(problem, maxh=0.25, order=order)
        settled(solution)
        return solution.relative_error_bound

    assert bound("axisymmetric") == pytest.approx(bound("plane strain"), rel=0.1)
