"""Polished solutions against exact ones, what is refused, and what is returned unchanged."""

from dataclasses import replace
from functools import cache

import ngsolve as ng
import numpy as np
import pytest

import ngcontact as nc
from drivers.benchmark.scenes.problems import BLOCK, DISC
from drivers.reference.cases import (
    UPWARDS,
    disc_on_rigid_plane,
    one_transition,
    partly_opening_block,
    pressure_patch,
    touching_blocks,
)
from drivers.reference.straight import relative_energy_error
from ngcontact import ContactWarning, adapt, polish, solve
from ngcontact.polishing.geometric_mesh import END_RATIO, coarse_mesh
from ngcontact.polishing.polishing import solve_bilateral
from tests.given_meshes import two_blocks
from tests.scenes import pressed_ball


@cache
def solved_disc():
    """The disc on a rigid plane within two percent."""
    *_, coarse = adapt(disc_on_rigid_plane(), tolerance=2e-2)
    return coarse


@cache
def polished_disc(digits):
    """The same, polished."""
    return polish(solved_disc(), digits)


def test_disc_on_a_rigid_plane():
    polished = polished_disc(7)
    assert polished.displacement.space.ndof < 4000
    assert polished.order == 8
    assert 2 * polished.contact_force()[1] == pytest.approx(DISC.force, rel=1e-7)
    assert polished.energy == pytest.approx(DISC.energy, rel=1e-7)
    assert polished.pressure[polished.points[:, 0].argmin()] == pytest.approx(DISC.peak, rel=1e-6)
    assert polished.transitions()[0, 0] == pytest.approx(DISC.half_width, rel=1e-6)


def test_what_a_polished_solution_serves(tmp_path):
    polished = polished_disc(4)
    assert polished.order == 6
    table = polished.quantities()
    for name, value in (("force", DISC.force / 2), ("energy", DISC.energy)):
        assert abs(table[name].value - value) <= table[name].error
    assert table["energy"].error <= 1e-5 * DISC.energy  # proved
    assert polished.contact_area() == pytest.approx(np.arcsin(DISC.half_width), rel=5e-4)
    assert polished.residuals["equilibrium"] < 1e-12
    polished.write(tmp_path / "disc.vtu")
    loaded = nc.load(polished.save(tmp_path / "disc.ngcontact"))
    assert np.array_equal(loaded.force, polished.force)
    assert np.array_equal(loaded.transitions(), polished.transitions())
    assert loaded.energy == pytest.approx(polished.energy, rel=1e-12)


@cache
def solved_root():
    """The square root of one end within one percent."""
    *_, coarse = adapt(one_transition().problem, tolerance=1e-2)
    return coarse


def test_errors_fall_exponentially_with_the_third_root_of_unknowns():
    """On one mesh with its vertex at the end of contact, orders 2 to 8."""
    coarse, case = solved_root(), one_transition()
    mesh = coarse_mesh(coarse.problem, coarse.pairs, 2.0)
    [end] = mesh.ends
    mesh = mesh.moved(end, -mesh.vertices[end.vertex, 0])
    mesh = mesh.with_layers(end.vertex, END_RATIO, 6)
    solutions = [solve_bilateral(coarse.problem, mesh, order) for order in (2, 4, 6, 8)]
    error = np.log([relative_energy_error(one, case.exact) for one in solutions])
    root = np.cbrt([one.displacement.space.ndof for one in solutions])
    slope = -np.diff(error) / np.diff(root)
    assert slope.min() > 0.4
    assert slope.max() < 1.5 * slope.min()
    assert error[-1] < np.log(1e-4)


def refused():
    """What is refused, by words of the message."""
    coarse, case = solved_disc(), one_transition()
    plane, touching = coarse.problem, case.problem
    bilateral = replace(plane, contact=[replace(plane.contact[0], bilateral=True)])
    dual = replace(touching, contact=[replace(touching.contact[0], rows="dual")])
    given = replace(touching, geometry=two_blocks(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9)))
    return {
        "digits=0": (coarse, 0),
        "digits=13": (coarse, 13),
        "digits=8.0 is not an integer": (coarse, 8.0),
        "not a Problem": (plane, 8),
        "solids": (replace(coarse, problem=pressed_ball(0.1)), 8),
        "bodies of revolution": (replace(coarse, problem=replace(plane, model="axisymmetric")), 8),
        "is bilateral": (solve(bilateral, maxh=0.5), 8),
        "geometry, not a mesh": (solve(given), 8),
        "face no nodes": (solve(dual, maxh=0.5), 8),
        "no ends": (solve(pressure_patch().problem, maxh=0.5), 8),
    }


def test_what_it_does_not_serve_is_refused_by_name():
    for words, (solution, digits) in refused().items():
        with pytest.raises((ValueError, TypeError), match=words):
            polish(solution, digits)


def test_a_zone_of_another_load_is_returned_unchanged():
    """Its ends are too far away to be followed."""
    coarse = solved_disc()
    pressed = replace(coarse.problem, displacement={"top": (None, -0.05)})
    with pytest.warns(ContactWarning, match="polish returns the solution as it is: its ends"):
        assert polish(other := replace(coarse, problem=pressed)) is other


@pytest.mark.parametrize("digits", [5, 6, 7])
@pytest.mark.parametrize(
    ("make", "exact", "sides"), [(disc_on_rigid_plane, DISC, 2), (partly_opening_block, BLOCK, 1)]
)
def test_estimated_errors_are_larger_than_the_true_ones(make, exact, sides, digits, caplog):
    """The log tells them, as errors of forces and energy; the references have nine digits."""
    *_, coarse = adapt(make(), tolerance=1e-2)
    caplog.set_level("INFO", logger="ngcontact")
    polished = polish(coarse, digits)
    told = float(caplog.messages[-1].rsplit(" ", 1)[1])
    assert told < 1e-4
    assert sides * polished.contact_force()[1] == pytest.approx(exact.force, rel=told)
    assert abs(polished.energy) == pytest.approx(exact.energy, rel=told)


def test_a_zone_that_is_missed_is_returned_unchanged():
    """The gap closes at x = 0.4 and, which the given solution does not know, at x = -0.5."""
    dip = (ng.x - 0.4) ** 2
    second = dip * ((ng.x + 0.5) ** 2 + 0.01) / 0.81
    known, whole = (
        touching_blocks(
            {"top": (0, -0.02), "bottom": (0, 0)}, contact=[replace(UPWARDS, gap=0.5 * gap)]
        )
        for gap in (dip, second)
    )
    *_, coarse = adapt(known, tolerance=5e-2)
    assert len(coarse.transitions()) == 2
    with pytest.warns(ContactWarning, match="polish returns the solution as it is: pair 0 penetr"):
        assert polish(other := replace(coarse, problem=whole), digits=4) is other


def test_weight_inside_of_elements_counts():
    """Unknowns inside of elements are eliminated, and have loads of their own."""
    problem = replace(disc_on_rigid_plane(), force={"disc": (0, -0.3)})
    *_, coarse = adapt(problem, tolerance=2e-2)
    *_, fine = adapt(problem, tolerance=1e-3)
    polished = polish(coarse, digits=5)
    assert polished.order > 4
    error = fine.relative_error_estimate**2
    assert polished.energy == pytest.approx(fine.energy, rel=error)
