"""Press fits drawn as overlap, against Lame's rings: nodes face nodes along the normals."""

import math
from types import SimpleNamespace

import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import OCCGeometry

from drivers.reference.straight import relative_energy_error
from ngcontact import Contact, Elastic, Problem, adapt, solve
from ngcontact.geometries import rings

BORE, RIM = 0.5, 2.0  # radii; the shaft has 1
LAWS = {"inner": Elastic(E=1.0, nu=0.3), "outer": Elastic(E=2.0, nu=0.25)}
SIDES = ("outer_contact", "inner_contact")


def lame(interference):
    """Radius of the rim in contact, B and C of each ring under the pressure 1 / radius on it.

    The radial stress is B - C / r^2.
    """
    found = {}
    for name, radius, free in (("inner", 1.0, BORE), ("outer", 1.0 - interference, RIM)):
        B = radius / (free**2 - radius**2)
        found[name] = radius, B, B * free**2
    return found


def line_force(interference, growth=0.0):
    """Force per angle p r between the rings, the same on both sides.

    The inner one is drawn larger by `interference` and grown by `growth` relative to the outer one.
    """
    give = 0.0
    for name, (r, B, C) in lame(interference).items():
        law = LAWS[name]
        give += abs((1 + law.nu) / law.E * ((1 - 2 * law.nu) * B * r + C / r))
    return (interference + growth) / give


def exact(interference):
    """Stress of each ring, and the pressure on each side."""
    line, r2, stress, pressure = line_force(interference), ng.x**2 + ng.y**2, {}, {}
    for name, (r, B, C) in lame(interference).items():
        radial, hoop = line * (B - C / r2), line * (B + C / r2)
        xx, yy = (radial * u**2 + hoop * v**2 for u, v in ((ng.x, ng.y), (ng.y, ng.x)))
        xy = (radial - hoop) * ng.x * ng.y
        stress[name] = ng.CF((xx, xy, xy, yy), dims=(2, 2)) / r2
        pressure[name] = line / r
    return SimpleNamespace(stress=stress), pressure


def fit(interference, swap=False, strain=None, **options):
    """A quarter of the rings."""
    return Problem(
        geometry=rings(BORE, 1.0, RIM, interference, quarter=True),
        materials=LAWS,
        sliding="inner_cut_x|inner_cut_y|outer_cut_x|outer_cut_y",
        strain=strain or {},
        contact=[Contact(*(SIDES[::-1] if swap else SIDES), **options)],
    )


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("interference", [1e-5, 1e-1])
@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.study(witness=["4-0.1-False"])
def test_press_fits_converge_to_lame(order, interference, swap):
    stress, pressure = exact(interference)
    right = pressure["inner" if swap else "outer"]
    levels = list(adapt(fit(interference, swap), order=order, max_dofs=5000))
    estimates = [level.relative_error_estimate for level in levels]
    errors = [relative_energy_error(level, stress) for level in levels]
    assert all(error <= known for error, known in zip(errors, estimates, strict=True))
    unknowns = [level.displacement.space.ndof for level in levels]
    rate = np.polyfit(np.log(unknowns[-4:]), np.log(estimates[-4:]), 1)[0]
    assert rate < -0.45 * order  # theory: half the order
    last = levels[-1]
    assert last.active.all()
    # Asked for on the last level: force within 2e-2 (order 1), 1e-3; peak within 5e-2, 1e-2.
    line = last.force.sum() / (right * (1.0 if swap else 1.0 - interference) * math.pi / 2)
    assert abs(line - 1) < (2e-2 if order == 1 else 1e-3)
    assert abs(last.pressure.max() / right - 1) < (5e-2 if order == 1 else 1e-2)


@pytest.mark.parametrize("swap", [False, True])
def test_roles_that_are_chosen_do_not_depend_on_those_given(swap):
    """Of two sides that cover each other, with equal segments, the convex one."""
    solution = solve(fit(1e-3, swap, roles="auto"), maxh=0.2, order=2)
    assert solution.pairs[0].line.contact.secondary == "inner_contact"


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("gap", [None, 1e-3])
@pytest.mark.parametrize(("order", "error"), [(1, 0.1), (2, 2e-3), (3, 1e-4), (4, 1e-6)])
def test_a_shaft_turns_in_its_hub_on_meshes_that_do_not_match(order, error, gap, swap):
    """It is warm, has a clearance of 1e-3, and no supports; measured 6e-2, 9e-4, 3e-5, 4e-7.

    Rows whose reactions are not in line with the forces resisted its turn, and loaded it.
    """
    shape = rings(BORE, 1.0, RIM, -1e-3).shape
    for face in shape.faces:
        face.maxh = 0.3 if face.name == "inner" else 0.17
    problem = Problem(
        geometry=ng.Mesh(OCCGeometry(shape, dim=2).GenerateMesh()),
        materials=LAWS,
        strain={"inner": 0.01},
        contact=[Contact(*(SIDES[::-1] if swap else SIDES), gap=gap)],
    )
    solution = solve(problem, order=order)
    assert solution.problem.contact[0].secondary == SIDES[swap]
    assert sum("translation" in str(motion) for motion in solution.free_motions) == 2  # of both
    assert len(solution.free_motions) == 4  # and two turns
    right = line_force(-1e-3, 0.01 * (1 + LAWS["inner"].nu))
    assert abs(solution.force.sum() / (2 * math.pi * right) - 1) < error
