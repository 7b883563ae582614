"""Bodies held by contact alone: HH81 Remark 3.7."""

import math
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Contact, Elastic, NoEquilibriumError, Problem, adapt, solve
from ngcontact.discrete.discrete_problem import minimise_energy
from ngcontact.geometries import rings
from ngcontact.geometries.region import body, compound, quarter_arc
from ngcontact.mesh import first_mesh
from tests.scenes import rectangle

STEEL = Elastic(E=1000.0, nu=0.3)
WEIGHT = 0.1  # of a disc, per area
ROUND_OFF = 1e-12  # of sums of forces and moments: the figure asked for; measured 4e-14


def pressed_blocks(load=1.0, **more):
    return cases.touching_blocks(
        {"bottom": (0, 0)},
        materials={"upper|lower": STEEL},
        traction={"top": load},
        contact=[replace(cases.TOUCHING, **more)],
    )


def mesh_area(solution, body):
    return ng.Integrate(1, solution.mesh.Materials(body), order=2 * solution.order)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_a_block_that_can_slide(order):
    """Its sideways mean is zero, and the pressure is that of the block that is held."""
    solution = solve(pressed_blocks(), maxh=0.3, order=order)
    [motion] = solution.free_motions
    assert str(motion) == 'translation of "upper" along (1, 0)'
    assert motion.multiplier == pytest.approx(0, abs=ROUND_OFF)
    edge = solution.mesh.Boundaries("top|upper_.*")
    mean = ng.Integrate(solution.displacement[0], edge, order=2 * order)
    size = np.abs(solution.displacement.vec.FV().NumPy()).max()
    assert abs(mean) <= ROUND_OFF * size
    assert max(solution.residuals.values()) <= ROUND_OFF


@pytest.mark.parametrize("eccentricity", [0.0, 0.2, 0.5, 0.9])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_load_inside_the_base(order, eccentricity):
    """Inside the kern (2/6) all points bear, outside of it some; forces and moments balance."""
    load = ng.CF((0, -1 - 3 * eccentricity * ng.x))
    solution = solve(pressed_blocks(load), maxh=0.2, order=order)
    x, force = solution.points[:, 0], solution.force
    assert force.sum() == pytest.approx(2, rel=ROUND_OFF)
    assert (force * x).sum() == pytest.approx(2 * eccentricity, abs=2 * ROUND_OFF)
    assert solution.active.all() == (eccentricity < 1 / 3)
    assert max(solution.residuals.values()) <= ROUND_OFF
    assert solution.work["factorizations"] <= 2


@pytest.mark.parametrize(
    ("load", "motion", "work"),
    [
        # The resultant 2 at 1.05, 0.05 beyond the edge; the motion has size 1 at the half width.
        (ng.CF((0, -1 - 3 * 1.05 * ng.x)), r'rotation of "upper" about \(1, ', 0.1),
        (ng.CF((0.1, -1)), r'translation of "upper" along \(1, 0\)', 0.2),
        (ng.CF((0, 1)), r'translation of "upper" along \(0, 1\)', 2.0),
    ],
)
def test_no_equilibrium(load, motion, work):
    with pytest.raises(NoEquilibriumError, match=motion) as failure:
        solve(pressed_blocks(load), maxh=0.2, order=2)
    assert failure.value.body == "upper"
    assert failure.value.work == pytest.approx(work, rel=1e-9)
    assert failure.value.motion.bodies == ("upper",)


def seesaw(inside=0.0, secondary=0, rows="auto"):
    """A plate with the load 4, whose middle is so far inside of the end of the block below."""
    sides = "plate_bottom", "block_top"
    return Problem(
        geometry=compound(
            rectangle("plate", (-2 - inside, 2 - inside), (0, 1)),
            rectangle("block", (-2, 0), (-1, 0)),
        ),
        materials={".*": STEEL},
        displacement={"block_bottom": (0, 0)},
        traction={"plate_top": 1.0},
        contact=[Contact(sides[secondary], sides[1 - secondary], rows=rows)],
    )


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize(("secondary", "rows"), [(0, "auto"), (1, "auto"), (0, "dual")])
def test_a_load_through_the_end_of_contact(secondary, rows, order):
    """It needs a force at a point; on V_h it has many solutions, which no two levels share."""
    with pytest.raises(NoEquilibriumError, match=r"an end of its zone, at \(0, 0\)") as failure:
        solve(seesaw(0.0, secondary, rows), maxh=0.4, order=order)
    assert 'rotation of "plate" about' in str(failure.value.motion)
    assert failure.value.work == 0.0


def test_a_load_beside_the_end_of_contact():
    """As near as 1e-5 of it: each tenth of the way takes the same energy, that of two wedges.

    Under F at its tip the stress of a wedge is radial, -F (c cos t / (a + sin a cos a) + s sin t /
    (a - sin a cos a)) / r, for the half angle a and a force (c, s) along and across its axis.
    """
    energies = [list(adapt(seesaw(x), tolerance=1e-2))[-1].energy for x in (1e-4, 1e-5)]
    half_plane, quarter = 1 / math.pi, 1 / (math.pi / 2 + 1) + 1 / (math.pi / 2 - 1)
    modulus = STEEL.E / (1 - STEEL.nu**2)
    per_tenth = 4.0**2 / modulus * (half_plane + quarter / 2) * math.log(10)
    # The energies of both have relative errors below 1e-4, of which their difference is a fifth.
    assert energies[0] - energies[1] == pytest.approx(per_tenth, rel=1e-3)


IMBALANCE = 1e-5  # of the size of the load


def with_imbalance(problem, share):
    """The lower body of S7 pushed along x by a share of the load's size, the guides resist not."""
    mesh = first_mesh(problem, 0.2)
    size = sum(
        ng.Integrate(ng.Norm(F), mesh, definedon=mesh.Materials(body), order=10)
        for body, F in problem.force.items()
    )
    area = ng.Integrate(1, mesh, definedon=mesh.Materials("lower"))
    push = problem.force["lower"] + ng.CF((share * float(size) / area, 0))
    return replace(problem, force={**problem.force, "lower": push})


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("order", "maxh"), [(1, 0.26), (2, 0.477), (4, 0.2)])
@pytest.mark.study(witness=["1-0.26-1", "1-0.26--1", "4-0.2--1"])
def test_a_small_imbalance_of_such_loads_is_refused(order, maxh, sign):
    """Also where the rules of V_h leave a hundred times as much, of either sign."""
    problem = with_imbalance(cases.guided_transition().problem, sign * IMBALANCE)
    with pytest.raises(NoEquilibriumError, match='translation of "lower" along') as failure:
        solve(problem, maxh=maxh, order=order)
    [tx, _] = failure.value.motion.translation[0]
    assert tx * sign > 0
    push = problem.force["lower"] - cases.guided_transition().problem.force["lower"]
    mesh = first_mesh(problem, maxh)
    work = float(ng.Integrate(push[0], mesh, definedon=mesh.Materials("lower")))
    # The measured error is 2e-7 of the size of the load that does work, 3 times that here.
    assert failure.value.work == pytest.approx(abs(work), rel=0.1)


def loose(load):
    """A ring that lies in a wider one, 0.02 from it all around, under a force on it."""
    return Problem(
        geometry=rings(interference=-0.02),
        materials={"inner|outer": STEEL},
        displacement={"rim": (0, 0)},
        force={"inner": load},
        contact=[Contact("inner_contact", "outer_contact")],
    )


@pytest.mark.parametrize("order", [1, 2])
def test_the_shape_of_a_mesh_does_no_work(order):
    """The middle of a polygon is not quite that of its circle: weight does not turn the ring."""
    solution = solve(loose((0, -WEIGHT)), maxh=0.2, order=order)
    [turning] = solution.free_motions
    assert str(turning).startswith('rotation of "inner" about')
    weight = WEIGHT * mesh_area(solution, "inner")
    assert np.abs(solution.contact_force() - [0, weight]).max() < 1e-9 * weight
    with pytest.raises(NoEquilibriumError, match="rotation"):
        solve(loose((0, -WEIGHT * (1 + 1e-4 * ng.x))), maxh=0.2, order=order)


@pytest.mark.parametrize("order", [1, 2])
def test_a_body_that_may_turn_from_every_first_active_set(order):
    """The proximal force turns the ring, which its contact cannot: no singular system."""
    solution = solve(loose((0, -WEIGHT)), maxh=0.4, order=order)
    weight, m = WEIGHT * mesh_area(solution, "inner"), len(solution.points)
    for carried in ([], [0], [m // 3, 2 * m // 3], range(m)):
        active = np.zeros(m, dtype=bool)
        active[list(carried)] = True
        force = minimise_energy(solution.discrete, active).force
        total = force @ solution.discrete.lines[0].direction
        np.testing.assert_allclose(total, [0, -weight], atol=1e-10 * weight)  # measured 2e-13


@pytest.mark.study(witness=["0.05-1"])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("gap", [0.0, 1e-12, 0.05, 10.0])
def test_a_disc_falls_on_a_block(gap, order):
    """Its contact carries its weight, however far it falls."""
    around = enumerate(("over", "over", "arc", "arc"))
    disc = body("disc", [(name, quarter_arc((0, 0), 1.0, k, (k + 1) % 4)) for k, name in around])
    sides = "bottom", "side", "block_top", "side"
    problem = replace(
        pressed_blocks(),
        geometry=compound(disc, rectangle("block", (-2, 2), (-2 - gap, -1 - gap), sides)),
        materials={"disc|block": STEEL},
        traction={},
        force={"disc": (0, -WEIGHT)},
        contact=[Contact("arc", "block_top", direction=(0, -1))],
    )
    solution = solve(problem, maxh=0.25, order=order)
    weight = WEIGHT * mesh_area(solution, "disc")
    assert np.abs(solution.contact_force() - [0, weight]).max() <= 1e-10 * weight
