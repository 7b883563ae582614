"""Bodies held by contact alone (HH81 Remark 3.7): at rest on others, tipping over, sliding away."""

from __future__ import annotations

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from drivers.stress import RESIDUAL
from drivers.stress.trials.held import STEEL, WEIGHT, disc_above_block, disc_in_notch, stack
from ngcontact import Contact, NoEquilibriumError, Problem, solve
from ngcontact.geometries import blocks

BALANCE = 1e-12  # of forces and moments, relative to the load: round-off


def foundation(load):
    """Block of width 2 on a clamped one."""
    return Problem(
        geometry=blocks(),
        materials={"upper|lower": STEEL},
        displacement={"bottom": (0, 0)},
        traction={"top": load},
        contact=[Contact("upper_contact", "lower_contact")],
    )


def eccentric(e):
    """Load of resultant 2 at x = e on the block of width 2."""
    return ng.CF((0, -1 - 3 * e * ng.x))


@pytest.mark.parametrize("e", [0.0, 0.2, 0.32, 0.34, 0.6, 0.95])
@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.study(witness=["2-0.34"])
def test_a_block_on_a_foundation_balances_its_load(order, e):
    s = solve(foundation(eccentric(e)), maxh=0.2, order=order)
    assert abs(s.force.sum() - 2) <= 2 * BALANCE
    assert abs((s.force * s.points[:, 0]).sum() - 2 * e) <= 2 * BALANCE
    assert max(s.residuals.values()) <= RESIDUAL


@pytest.mark.parametrize(
    ("load", "motion"),
    [
        (eccentric(1.01), "rotation"),  # outside of the base
        (ng.CF((1e-3, -1)), "translation"),  # sliding
        (ng.CF((0, 1)), "translation"),  # pulling
    ],
)
def test_loads_that_nothing_balances_are_refused(load, motion):
    with pytest.raises(NoEquilibriumError, match=f'{motion} of "upper"'):
        solve(foundation(load), maxh=0.2, order=2)


@pytest.mark.study(witness=["disc, gap 0.05-1"])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(
    ("make", "shares"),
    [(lambda gap=gap: disc_above_block(gap), [[0, 1]]) for gap in (0.0, 1e-12, 0.05, 10.0)]
    + [(disc_in_notch, [[0.5, 0.5], [-0.5, 0.5]])],
    ids=[*(f"disc, gap {gap}" for gap in (0.0, 1e-12, 0.05, 10.0)), "notch"],
)
def test_contact_forces_are_the_weight_above(make, shares, order):
    problem, weight = make()
    s = solve(problem, maxh=0.25, order=order)
    # Weight by quadrature of a curved disc, exact at the mesh's own area.
    disc = WEIGHT * ng.Integrate(1, s.mesh.Materials("disc"), order=8)
    forces = np.array([s.contact_force(k) for k in range(len(s.pairs))])
    # Symmetric within what the mesh, which is not, leaves of the moment.
    assert np.abs(forces - disc * np.array(shares)).max() <= 1e-10 * weight


@pytest.mark.study(witness=["1"])
@pytest.mark.parametrize("order", [1, 2, 4])
def test_a_stack_of_three(order):
    problem, loads = stack()
    s = solve(problem, maxh=0.3, order=order)
    for k, load in enumerate(loads):
        assert abs(s.contact_force(k)[1] - load) <= BALANCE * loads[0]


def test_contact_may_open_completely():
    problem = replace(cases.clamped_transition().problem, traction={}, force={})
    pulled = replace(problem, displacement={"top": (0, 0.01), "bottom": (0, 0)})
    s = solve(pulled, maxh=0.2, order=2)
    assert np.abs(s.gap - 0.01).max() <= 0.01 * BALANCE
