"""What solids tell of their contact: ends, area, pressure as a field, quantities with errors."""

import math

import netgen.occ as occ
import ngsolve as ng
import numpy as np
import pytest

from drivers.reference.solids import hertz_of_solids, relative_energy_error
from ngcontact import Contact, Elastic, Problem, adapt, solve
from ngcontact.fem import unknowns
from ngcontact.geometries.solids import shells
from tests.solids.meshes import boxes, named
from tests.solids.test_curved import PRESSURE, errors, press_fit, unmatched
from tests.solids.test_patch import TURN

HERTZ, EXACT = hertz_of_solids()
RADIUS, PEAK, FORCE = EXACT.a, EXACT.p0, EXACT.P / 4  # of a quarter


@pytest.fixture(scope="module")
def levels():
    """Hertz contact of two cubes by order, level by level."""
    most = {1: 4_000, 2: 40_000, 3: 22_000}
    return {order: list(adapt(HERTZ, order=order, max_dofs=n)) for order, n in most.items()}


def radius_of(polyline):
    """Of the circle with the area that a quarter of it encloses."""
    x, y = polyline[:, :2].T
    return math.sqrt(2 / math.pi * abs((x[:-1] * y[1:] - x[1:] * y[:-1]).sum()))


@pytest.mark.parametrize(
    ("order", "enclosed", "points"), [(1, 3e-2, 1e-1), (2, 3e-3, 2e-2), (3, 1e-2, 6e-2)]
)
def test_end_of_hertz_contact(levels, order, enclosed, points):
    """One quarter of a circle, from one plane of symmetry to the other.

    Measured, by the area that it encloses: 1.1e-2, 1.1e-5 and 6.8e-3; of its points: 7.2e-2, 1.5e-2
    and 3.6e-2, at 2.0e3, 2.6e4 and 2.0e4 unknowns.
    """
    solution = levels[order][-1]
    [end] = solution.transitions()
    r = np.linalg.norm(end, axis=1)
    assert radius_of(end) == pytest.approx(RADIUS, rel=enclosed)
    assert r == pytest.approx(RADIUS, rel=points)
    assert sorted(np.abs(end[[0, -1]]).min(axis=1)) == [0, 0]
    assert np.abs(end[:, 2]).max() == 0
    assert solution.contact_area() == pytest.approx(math.pi / 4 * radius_of(end) ** 2, rel=1e-9)


@pytest.mark.parametrize(("order", "rms"), [(2, 8e-3), (3, 1.5e-2)])
def test_pressure_field_of_hertz_contact(levels, order, rms):
    """Away from the end, relative to the peak, by area. Measured: 4.8e-3 and 9.0e-3."""
    solution = levels[order][-1]
    field, square = solution.pressure_field(), ng.x**2 + ng.y**2
    inside = ng.IfPos((0.8 * RADIUS) ** 2 - square, 1.0, 0.0)
    exact = PEAK * ng.sqrt(ng.IfPos(RADIUS**2 - square, 1 - square / RADIUS**2, 0))
    top = ng.ds("lower_contact", bonus_intorder=8)
    miss = ng.Integrate(inside * (field - exact) ** 2 * top, solution.mesh)
    assert math.sqrt(miss / ng.Integrate(inside * top, solution.mesh)) < rms * PEAK
    assert isinstance(field.space, ng.H1 if order == 2 else ng.SurfaceL2)
    # The resultant is that of the contact, on plane facets.
    total = ng.Integrate(field * top, solution.mesh)
    assert total == pytest.approx(solution.force.sum(), rel=1e-10)


def test_levels(levels):
    """Effectivity: measured 4.5 to 4.8 on all but the first."""
    run = levels[2]
    for level in run[1:]:
        error = relative_energy_error(level, EXACT)
        assert 3 < level.relative_error_estimate / error < 8
    assert error < 6e-2  # measured
    assert (np.diff([level.relative_error_estimate for level in run]) < 0).all()
    assert all(level.work["gap_searches"] == 0 for level in run)  # nodes face nodes
    # Bisection leaves edges of no element in NGSolve's count of edges.
    sizes = [level.displacement.space.ndof for level in run]
    assert sizes == [unknowns(level.mesh, 2, "isoparametric") for level in run]


def test_quantities(levels):
    """Without errors of one level; with the larger of two differences of three."""
    assert all(row.kind == "none" and math.isnan(row.error) for row in levels[2][1].quantities())
    told = [level.quantities() for level in levels[2]]
    last = told[-1]
    exact = {
        "force": FORCE,
        "force, x": 0,
        "force, z": -FORCE,
        "contact area": math.pi / 4 * RADIUS**2,
        "mean pressure": FORCE / (math.pi / 4 * RADIUS**2),
        "peak pressure": PEAK,
    }
    for name, value in exact.items():
        row = last[name]
        values = [level[name].value for level in told[-3:]]
        assert row.error == np.abs(np.diff(values)).max()
        assert row.kind == "estimated"
        assert abs(row.value - value) <= row.error, name
    assert last["energy"].value == levels[2][-1].energy
    assert np.linalg.norm(last["peak pressure"].place) < RADIUS / 4
    assert "larger of the last two differences" in str(last)


@pytest.mark.parametrize(("order", "rms"), [(2, 2e-2), (3, 3e-2)])
@pytest.mark.parametrize("matched", [True, False])
def test_press_fit(order, rms, matched):
    """Of shells: the whole sphere touches, at one pressure, of points and as a field.

    Measured, of means and deviations at points: 8.3e-3, 1.8e-2 at order 2 and 1.8e-4, 1.3e-2 at
    order 3 if matched, else 5.9e-3, 1.8e-2 and 7.4e-5, 1.1e-2. Of the field: 1.3e-2 to 1.4e-2 at
    order 2, 2.2e-2 to 2.3e-2 at order 3, where tractions are those of the elements.
    """
    problem = press_fit(shells())
    mesh = None if matched else unmatched(0.3, 0.35)
    solution = solve(problem, mesh, maxh=0.35 if matched else None, order=order)
    assert solution.work["gap_searches"] == (not matched)
    mean, deviation = errors(solution)
    assert mean < {2: 1e-2, 3: 4e-4}[order]
    assert deviation < {2: 2e-2, 3: 1.5e-2}[order]
    [x, y, z] = solution.contact_force() / (-math.pi / 4 * PRESSURE)
    assert max(abs(x - y), abs(y - z)) < 1e-2
    name = problem.contact[0].secondary
    area = ng.Integrate(1, solution.mesh.Boundaries(name))
    assert solution.transitions() == []
    assert solution.contact_area() == pytest.approx(area, rel=1e-6)
    miss = solution.pressure_field() / PRESSURE - 1
    found = math.sqrt(ng.Integrate(miss**2 * ng.ds(name), solution.mesh) / area)
    assert found < rms


def test_nothing_in_contact():
    """A cube above an obstacle that it does not reach."""
    problem = Problem(
        boxes(("a", (0, 0, 0), (1, 1, 1), (2, 2, 2))),
        {"a": Elastic(1.0, 0.3)},
        displacement={"a_top": (0, 0, 0)},
        contact=[Contact("a_bottom", direction=(0, 0, -1), gap=0.1)],
    )
    for order in (1, 2, 3):
        solution = solve(problem, order=order)
        assert solution.transitions() == []
        assert solution.contact_area() == 0
        assert all(row.value == 0 for row in solution.quantities())


def indented():
    """A block under a rigid paraboloid, whole, whose lowest point is .1 in it."""
    return Problem(
        boxes(("a", (-1, -1, -1), (1, 1, 0), (8, 8, 4)), turn=TURN),
        {"a": Elastic(1.0, 0.3)},
        displacement={"a_bottom": (0, 0, 0)},
        contact=[
            Contact(
                "a_top",
                direction=TURN[:, 2],
                gap=lambda x, y, z: (x * x + y * y + z * z) / 2 - 0.1,
            )
        ],
    )


@pytest.mark.parametrize("order", [1, 2])
def test_closed_ends(order):
    one = solve(indented(), order=order)
    [end] = one.transitions()
    assert np.array_equal(end[0], end[-1])
    assert np.abs(end @ TURN[:, 2]).max() < 1e-15
    flat = end @ TURN[:, :2]
    x, y = flat.T
    enclosed = abs((x[:-1] * y[1:] - x[1:] * y[:-1]).sum()) / 2
    assert one.contact_area() == pytest.approx(enclosed, rel=1e-12)
    angle = np.unwrap(np.arctan2(y, x))
    assert abs(angle[-1] - angle[0]) == pytest.approx(2 * math.pi)  # once around


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_secondary_wider_than_its_primary(order):
    """A punch wholly in contact whose sides lie within facets of the block below.

    The field has the resultant of the contact, and no peak that the pressures of points lack.
    """
    block = named("block", occ.Box((-1, -1, -1), (1, 1, 0)))
    punch = named("punch", occ.Box((-0.53, -0.47, 0), (0.5, 0.5, 1)))
    problem = Problem(
        occ.OCCGeometry(occ.Compound([block, punch])),
        {".*": Elastic(1.0, 0.3)},
        displacement={"block_bottom": (0, 0, 0), "punch_top": (0, 0, -0.01)},
        contact=[Contact("block_top", "punch_bottom", roles="given")],
    )
    solution = solve(problem, maxh=0.4, order=order)
    force = -solution.contact_force()[2]
    assert force == pytest.approx(solution.force.sum(), rel=1e-9)
    assert solution.contact_area() == pytest.approx(1.03 * 0.97, rel=0.015)
    top = solution.mesh.Boundaries("block_top")
    field = solution.pressure_field()
    assert ng.Integrate(field, top) == pytest.approx(force, rel=1e-9)
    corners = ng.IntegrationRule([(1, 0), (0, 1), (0, 0)], [1] * 3)
    values = np.asarray(field(solution.mesh.MapToAllElements(corners, top)))
    assert values.max() < 1.5 * solution.pressure.max()  # measured: 1.27, 0.77 and 1.12 times
    assert order == 3 or values.min() >= 0


def test_the_wide_side_follows_a_round_rim():
    """The foot of a guided cylinder of radius 0.5 on a block, whose top carries the points.

    With the chords of whole edges as its rim the area was 4.5 % less, with those of quarters 0.33.
    """
    foot = named("foot", occ.Cylinder(occ.Pnt(0, 0, 0), occ.Z, 0.5, 1.2))
    block = named("block", occ.Box((-1, -1, -1), (1, 1, 0)))
    problem = Problem(
        geometry=occ.OCCGeometry(occ.Compound([foot, block])),
        materials={"foot|block": Elastic(1.0, 0.3)},
        displacement={"block_bottom": (0, 0, 0)},
        sliding="foot_side",
        traction={"foot_top": 0.02},
        contact=[Contact("block_top", "foot_bottom", direction=(0, 0, 1))],
    )
    solution = solve(problem, maxh=0.5, order=2)
    assert solution.contact_area() == pytest.approx(0.25 * np.pi, rel=5e-3)
    # A guide along the exact normals lets it turn.
    assert [str(motion).split(" ")[0] for motion in solution.free_motions] == ["rotation"]
