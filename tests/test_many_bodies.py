"""Scenes of many bodies: a bearing of twelve rollers between two rings, 24 pairs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from netgen.occ import ArcOfCircle, Pnt

from ngcontact import Contact, Elastic, Problem, adapt, find_contacts, solve
from ngcontact.arrays import by_field, dense
from ngcontact.contact import by_line, contact_line, lines_together
from ngcontact.discrete import carried_active_set
from ngcontact.fem import boundary_trace
from ngcontact.geometries.region import body, compound, polygon, quarter_arc
from ngcontact.mesh import first_mesh
from tests.given_meshes import mesh_of

ROLLERS, RADIUS, RACE, THICKNESS = 12, 0.2, 1.0, 0.3
STEP = 2 * math.pi / ROLLERS


def arc(centre, radius, start, stop):
    """Between two angles."""
    angles = (start, (start + stop) / 2, stop)
    return ArcOfCircle(
        *(
            Pnt(centre[0] + radius * math.cos(t), centre[1] + radius * math.sin(t), 0)
            for t in angles
        )
    )


def bearing():
    """Rollers that touch both rings, the first below the origin."""
    angles = [k * STEP - math.pi / 2 for k in range(ROLLERS)]
    far, bodies = RACE + 2 * RADIUS, []
    for name, low, high, hole, rim in (
        ("inner", RACE - THICKNESS, RACE, "bore", "inner_race"),
        ("outer", far, far + THICKNESS, "outer_race", "rim"),
    ):
        outline = [(rim, arc((0, 0), high, a, a + STEP)) for a in angles]
        inside = [(hole, arc((0, 0), low, a + STEP, a)) for a in angles[::-1]]
        bodies.append(body(name, outline, inside))
    for k, a in enumerate(angles, start=1):
        centre = (RACE + RADIUS) * math.cos(a), (RACE + RADIUS) * math.sin(a)
        quarters = [(a + math.pi / 2 * (i - 1), a + math.pi / 2 * i) for i in range(4)]
        names = [f"roller{k}_{side}" for side in ("out", "out", "in", "in")]
        loop = [(n, arc(centre, RADIUS, *q)) for n, q in zip(names, quarters, strict=True)]
        bodies.append(body(f"roller{k}", loop))
    return compound(*bodies)


@pytest.mark.filterwarnings("ignore:contact .*a zone in contact is")
@pytest.mark.filterwarnings("ignore:contact .*bodies pass through")
def test_a_bearing_with_twelve_rollers():
    geometry = bearing()
    pairs = find_contacts(geometry, within=1e-3)
    sides = [
        {f"roller{k}_{s}", f"{ring}_race"}
        for s, ring in (("in", "inner"), ("out", "outer"))
        for k in range(1, 13)
    ]
    assert len(pairs) == 24
    assert all({pair.secondary, pair.primary} in sides for pair in pairs)
    assert max(abs(pair.least_gap) for pair in pairs) < 1e-12
    problem = Problem(
        geometry,
        {".*": Elastic(E=2e5, nu=0.3)},
        displacement={"rim": (0, 0), "bore": (0, -1e-2)},
        contact=pairs,
    )
    levels = list(adapt(problem, order=2, max_dofs=12_500))
    # Rollers that nothing holds cost no steps: measured 4 and 6, and 7 and 13 by proximal steps.
    # Sizes between which refinement takes small steps take more: 8 to 12,000, 13 to 16,000.
    assert all(len(level.steps) <= 6 for level in levels)
    # ... and few back-solves: measured 15.
    assert levels[-1].work["back_solves"] <= 24
    # They start where they touched, at as many points of a finer mesh.
    known = levels[-2].pairs
    start = by_line(levels[-1].discrete.lines, carried_active_set(levels[-1].discrete.lines, known))
    largest_force = max(pair.force.max() for pair in known)
    idle = [k for k, pair in enumerate(known) if pair.force.max() < 1e-9 * largest_force]
    assert len(idle) == 10
    assert all(start[k].sum() <= known[k].active.sum() for k in idle)
    solution = levels[-1]
    force = {}
    for k, pair in enumerate(pairs):
        [name] = [side for side in pair.sides if "roller" in side]
        sign = 1 if pair.secondary == name else -1
        force[name] = sign * solution.contact_force(k)
    largest = max(map(np.linalg.norm, force.values()))
    inner = np.array([force[f"roller{k}_in"] for k in range(1, 13)])
    outer = np.array([force[f"roller{k}_out"] for k in range(1, 13)])
    # Each roller, and both rings, in equilibrium.
    assert np.abs(inner + outer).max() < 1e-10 * largest
    assert np.abs(solution.reactions["bore"] - inner.sum(axis=0)).max() < 1e-10 * largest
    assert np.abs(solution.reactions["rim"] - outer.sum(axis=0)).max() < 1e-10 * largest
    # Memory follows the unknowns: each of the 36 motions has entries on its own body alone.
    motions = solution.discrete.rigid.motions
    assert motions.nnz <= 4 * motions.shape[0]
    # Symmetric about the line of the load, to the error of the mesh; rollers above carry nothing.
    size = np.linalg.norm(inner, axis=1)
    assert np.abs(size[1:] - size[:0:-1]).max() < 1e-2 * largest
    assert (size[4:9] < 1e-9 * largest).all()
    assert (np.diff(size[:5]) < 0).all()


def test_a_body_that_hangs_beside_changes_no_indicator():
    """Its normals graze the block where another disc presses it."""
    pressed, beside = ((0.0, 1.0), "left"), ((2.5, 1.05), "right")
    discs = []
    for centre, name in (pressed, beside):
        around = enumerate(("top", "top", "arc", "arc"))
        arcs = [(f"{name}_{s}", quarter_arc(centre, 1.0, k, (k + 1) % 4)) for k, s in around]
        discs.append(body(name, arcs))
    block = body(
        "block", polygon([(4, 0), (-2, 0), (-2, -2), (4, -2)], ["top", "side", "rim", "side"])
    )
    problem = Problem(
        compound(*discs, block),
        {".*": Elastic(E=200.0, nu=0.3)},
        displacement={"rim|right_top": (0, 0), "left_top": (0, -0.05)},
        contact=[Contact("left_arc", "top"), Contact("right_arc", "top")],
    )
    both = solve(problem, maxh=0.3, order=2)
    alone = solve(replace(problem, contact=problem.contact[:1]), both.mesh, order=2)
    assert np.abs(both.indicators - alone.indicators).max() <= 1e-9 * alone.error_estimate


@pytest.mark.parametrize(("order", "thickness"), [(1, 0.09), (2, 0.09), (1, 0.01)])
def test_a_plate_one_element_thick_between_two_blocks(order, thickness):
    """All its vertices are in contact, so that rows are all unknowns that could hold it.

    With the plate as primary they are not. Energies differ by at most 3.7e-3.
    """
    top = 0.02 + thickness
    x, y = np.linspace(0, 1, 6), np.linspace(-0.1, 1.1, 8)
    names = {body: [f"{body}_{side}" for side in "brtl"] for body in ("low", "plate", "top")}
    mesh = mesh_of(
        [
            ("low", y, [-1.0, -0.5, 0.0], names["low"]),
            ("plate", x, [0.01, top - 0.01], names["plate"]),
            ("top", y, [top, 0.5, 1.0], names["top"]),
        ]
    )
    pairs = [Contact("plate_b", "low_t"), Contact("plate_t", "top_b")]
    energies = []
    for contact in (pairs, [pair.swapped() for pair in pairs]):
        problem = Problem(
            geometry=mesh,
            materials={"low|top|plate": Elastic(E=1.0, nu=0.3)},
            displacement={"low_b": (0, 0), "top_t": (0, -0.05)},
            contact=contact,
        )
        solution = solve(problem, order=order)
        one, other = (solution.contact_force(k) for k in (0, 1))
        np.testing.assert_allclose(one, -other, atol=1e-10 * np.abs(one).max())
        energies.append(solution.energy)
    assert energies[0] == pytest.approx(energies[1], rel=6e-3)


def test_lines_found_at_once_are_those_found_alone():
    geometry = bearing()
    pairs = find_contacts(geometry, within=1e-3)[:12]
    assert len({pair.primary for pair in pairs}) == 1
    mesh = first_mesh(Problem(geometry, {".*": Elastic(E=1, nu=0.3)}, contact=pairs), 0.2)
    mesh.Curve(2)
    trace = boundary_trace(mesh, 2)
    for pair, line in zip(pairs, lines_together(trace, pairs), strict=True):
        alone = contact_line(trace, pair)
        assert line.contact == pair
        for name, value in by_field(alone).items():
            if name not in ("contact", "searches"):
                one, other = (dense(x).astype(float) for x in (value, getattr(line, name)))
                # To round-off; measured 0.
                assert np.abs(one - other).max() <= 1e-12 * np.abs(one).max(), name
    away = [pairs[0], replace(pairs[1], secondary="roller7_out")]
    with pytest.raises(ValueError, match=r'no point of the secondary "roller7_out" faces'):
        lines_together(trace, away)
