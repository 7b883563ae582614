"""What a user reads from a solution: identities, signs, certificates, counts, variants of data."""

import copy
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Contact, Elastic, adapt, solve

SOFT = Elastic(E=1.0, nu=0.3)
STIFF = Elastic(E=3.0, nu=0.2)
# Identities that hold exactly on any mesh: required 1e-10, measured 1e-16 to 1e-13.
EXACT = 1e-10
LINE = Contact("upper_contact", "lower_contact")


def two_blocks(displacement=None, **data):
    """Blocks that touch along y = 0; the lower one is clamped, the upper one held along x."""
    return cases.touching_blocks(displacement or {"bottom": (0, 0), "top": (0, None)}, **data)


PROBLEMS = {
    "S1": lambda: cases.one_transition().problem,
    "S3": lambda: cases.hertz_contact().problem,
    "S7": lambda: cases.clamped_transition().problem,
    "S8": lambda: cases.curved_lines().problem,
    "S9": lambda: cases.ring_in_ring().problem,
    "polygon": lambda: cases.polygonal_patch().problem,
    "B": cases.partly_opening_block,
}


def values(solution):
    return solution.displacement.vec.FV().NumPy()


@pytest.mark.parametrize("order", [1, 4])
@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.study(witness=["B-1", "B-4", "S9-4"])
def test_every_body_is_in_equilibrium_and_every_point_optimal(name, order):
    solution = solve(PROBLEMS[name](), maxh=0.4, order=order)
    assert max(solution.residuals.values()) < EXACT
    largest, length = solution.force.max(), np.abs(values(solution)).max()
    assert solution.force.min() > -EXACT * largest
    assert solution.gap.min() > -EXACT * length
    assert (solution.force[~solution.active] == 0).all()
    assert np.abs(solution.gap[solution.active]).max() < EXACT * length
    size = sum(np.abs(force).sum() for force in solution.reactions.values())
    size += np.abs(solution.force).sum()
    names, mesh = np.array(solution.mesh.GetBoundaries()), solution.mesh
    for body_name in mesh.GetMaterials():
        own = set(names[list(mesh.Materials(body_name).Boundaries().Mask())])
        loads = np.zeros(2)
        for axis, direction in enumerate(((1, 0), (0, 1))):
            unit = ng.GridFunction(solution.displacement.space)
            unit.Set(ng.CF(direction), definedon=mesh.Materials(body_name))
            loads[axis] = solution.discrete.space.f @ unit.vec.FV().NumPy()
        reaction = sum((solution.reactions[n] for n in own & {*solution.reactions}), np.zeros(2))
        contact = np.zeros(2)
        for k, pair in enumerate(solution.problem.contact):
            contact += solution.contact_force(k) * ((pair.secondary in own) - (pair.primary in own))
        assert np.abs(loads + reaction + contact).max() < EXACT * size


def test_the_contact_force_pushes_the_secondary_off_the_primary():
    problem = two_blocks(traction={"top": 0.1})
    assert solve(problem, maxh=0.5).contact_force() == pytest.approx([0, 0.2], abs=1e-13)
    swapped = replace(problem, contact=[Contact("lower_contact", "upper_contact")])
    assert solve(swapped, maxh=0.5).contact_force() == pytest.approx([0, -0.2], abs=1e-13)


def test_bilateral_pairs_pull():
    """Remark 3.3: equality in place of the inequality."""
    problem = two_blocks(traction={"top": -0.1}, contact=[replace(LINE, bilateral=True)])
    for order in (1, 2, 4):
        solution = solve(problem, maxh=0.5, order=order)
        assert solution.contact_force() == pytest.approx([0, -0.2], abs=1e-12)
        assert solution.force.max() < 0
        assert np.abs(solution.gap).max() < 1e-14
        assert solution.active.all()
        assert solution.steps == [0]
        assert len(solution.transitions()) == 0
        assert max(solution.residuals.values()) < EXACT


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_a_guide_on_a_circle_holds_the_exact_normal(order):
    # A quarter of two rings, pressed from the hole against a guided rim.
    problem = cases.ring_in_ring().problem
    load = {"hole": 0.1 * (1 + ng.x)}
    problem = replace(problem, sliding=f"{problem.sliding}|rim", traction=load)
    solution = solve(problem, maxh=0.4, order=order)
    trace = solution.discrete.space.trace
    at = trace.at_nodes(trace.segments("rim"))
    x, u = trace.point(*at), trace.evaluate(solution.displacement, *at)
    assert np.abs(u).max() > 1e-5
    # Not in the mesh's normals: nodes lie on the circle, so that x / 2 is the exact one.
    assert np.abs((u * x).sum(axis=1)).max() < 1e-13 * np.abs(u).max()
    assert max(solution.residuals.values()) < EXACT


READ = {
    "energy": lambda s, folder: s.energy,
    "reactions": lambda s, folder: s.reactions,
    "stress_free": lambda s, folder: s.stress_free,
    "indicators": lambda s, folder: s.indicators,
    "error_estimate": lambda s, folder: s.error_estimate,
    "error_bound": lambda s, folder: s.error_bound,
    "quantities": lambda s, folder: s.quantities(),
    "stress": lambda s, folder: s.stress,
    "at": lambda s, folder: s.at((0.3, 0.3)),
    "write": lambda s, folder: s.write(folder / "moved.vtu"),
    "plot": lambda s, folder: s.plot(folder / "moved.png", field="displacement"),
    "save": lambda s, folder: s.save(folder / "moved.ngcontact"),
    "copy": lambda s, folder: copy.deepcopy(s),
    "record": lambda s, folder: s.record(),
    "draw": lambda s, folder: s.draw(),
    "adapt": lambda s, folder: next(adapt(s.problem, order=2, start=s)),
}


def refined(mesh):
    mesh.Refine()


def shifted(mesh):
    for point in mesh.ngmesh.Points():
        point[0] += 0.125


@pytest.mark.parametrize("change", [refined, shifted])
@pytest.mark.parametrize("name", READ)
def test_a_mesh_that_was_changed_after_solving_is_told(name, change, tmp_path):
    """The bound answered for other elements, the estimate ended in a product of matrices."""
    solution = solve(two_blocks(), maxh=0.5, order=2)
    pressure, vertices = solution.pressure.copy(), solution.mesh.nv
    change(solution.mesh)
    with pytest.raises(RuntimeError, match=f"changed after solving: {vertices} vertices then"):
        READ[name](solution, tmp_path)
    assert not list(tmp_path.iterdir())
    np.testing.assert_array_equal(solution.pressure, pressure)  # what was read stays
