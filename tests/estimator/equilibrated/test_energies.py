"""Bounds of the energy contain it on every level, and are as near to each other as B^2 is small."""

from __future__ import annotations

from dataclasses import replace

import ngsolve as ng
import pytest

from drivers.reference import cases
from ngcontact import Contact, Elastic, Hooke, adapt, solve
from tests.scenes import unmatched_blocks

ANISOTROPIC = Hooke([[100.0, 20.0, 5.0], [20.0, 10.0, 1.0], [5.0, 1.0, 3.0]])
BILATERAL = [Contact("upper_contact", "lower_contact", bilateral=True)]
SOFT = {"upper": Elastic(1e9, 0.3), "lower": Elastic(1e3, 0.2)}


def opening(**changes):
    """A block on a clamped one, pressed on half of its top."""
    return replace(cases.partly_opening_block(), **changes)


def transition(**changes):
    """One transition from contact to gap, with changes."""
    return replace(cases.one_transition().problem, **changes)


SCENES = {
    "one transition": transition,
    "dual rows": lambda: transition(geometry=unmatched_blocks()),
    "nearly incompressible": lambda: transition(materials={"upper|lower": Elastic(1.0, 0.499)}),
    "body forces": lambda: cases.clamped_transition().problem,
    "guided": lambda: cases.guided_transition().problem,
    "Hertz": lambda: cases.hertz_contact(half_width=0.5).problem,
    "rings": lambda: cases.ring_in_ring().problem,
    "rigid plane": cases.disc_on_rigid_plane,
    "punch": cases.flat_punch,
    "opening": opening,
    "bilateral": lambda: opening(contact=BILATERAL, traction={"pressed": -1.0}),
    "held by contact": lambda: opening(sliding="lower_axis", traction={"pressed|top": 1.0}),
    "plane stress": lambda: opening(model="plane stress"),
    "anisotropic": lambda: opening(materials={"upper|lower": ANISOTROPIC}),
    "contrast": lambda: opening(materials=SOFT),
}


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.filterwarnings("ignore:.*segments long")
@pytest.mark.study(witness=["bilateral"])
def test_energies_are_enclosed(scene):
    """By bounds of order 2 on all levels; the reference is what one of order 4 encloses.

    The width is at most B^2, and 1.5 times what data that no polynomial meets add; measured 0.5 to
    0.8 B^2. Curved meshes have domains of their own, by up to 3.1e-5 of the area (rings, where
    energies were 1.0e-5 apart): by as much of it the energies of both may differ.
    """
    problem = SCENES[scene]()
    *_, finest = adapt(problem, order=4, max_dofs=4000)
    lower, upper = finest.energy_bounds
    area = ng.Integrate(1, finest.mesh)
    for level in adapt(problem, order=2, max_dofs=1300):
        low, high = level.energy_bounds
        apart = abs(upper) * abs(ng.Integrate(1, level.mesh) / area - 1)
        assert low <= upper + apart
        assert lower <= high + apart
        noise = 1e-12 * (level.energy_norm**2 + abs(level.energy))
        assert high - low <= 1.5 * level.error_bound**2 + noise


@pytest.mark.parametrize("scene", ["dual rows", "one transition"])
def test_energies_are_apart_by_half_of_the_squared_bound_and_what_crosses(scene):
    """Under polynomial loads: |s - sigma_h| times |w| on each element is all that they add."""
    solution = solve(SCENES[scene](), maxh=0.5, order=2)
    proof, square = solution.equilibrated.proof, solution.error_bound**2
    norms, (low, high) = proof.norms, solution.energy_bounds
    crossed = norms.partition.of_elements(norms.constitutive) @ norms.lifting * proof.units.energy
    assert solution.bound_parts["lifting"] > 1e-3 * square
    # The energies are known to their round-off, of B^2 measured 3e-11.
    assert high - low == pytest.approx(square / 2 + crossed, abs=1e-9 * square)


def test_energies_of_stiff_bodies_keep_their_digits():
    """A body 1e8 times stiffer moves by what the soft one gives way: nothing of that is energy.

    Summed as u.Au two levels enclosed values 7e-12 apart, 30 times the distance of the finer ones.
    """
    problem = opening(materials={"upper": Elastic(1e11, 0.3), "lower": Elastic(1e3, 0.2)})
    *_, coarse, fine = (level.energy_bounds for level in adapt(problem, order=4, max_dofs=7000))
    assert coarse[0] <= fine[1]
    assert fine[0] <= coarse[1]
    assert fine[1] - fine[0] <= 3e-9 * abs(fine[0])
