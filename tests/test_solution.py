"""What a user reads from a solution: identities, signs, certificates, counts, variants of data."""

import copy
import math
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import Axis, OCCGeometry, Vec
from netgen.occ import Pnt as Point

from drivers.reference import cases
from ngcontact import Contact, Elastic, Problem, adapt, solve
from ngcontact.geometries import blocks, disc, disc_on_block, rings
from ngcontact.geometries.region import body, compound, polygon
from ngcontact.mesh.generation import first_mesh
from ngcontact.problem.values import boundary_mask

SOFT = Elastic(E=1.0, nu=0.3)
STIFF = Elastic(E=3.0, nu=0.2)
# Identities that hold exactly on any mesh: required 1e-10, measured 1e-16 to 1e-13.
EXACT = 1e-10
LINE = Contact("upper_contact", "lower_contact")


def two_blocks(**data) -> Problem:
    """Blocks that touch along y = 0; the lower one is clamped, the upper one held along x."""
    given = {
        "geometry": blocks(),
        "materials": {"upper": SOFT, "lower": STIFF},
        "displacement": {"bottom": (0, 0), "top": (0, None)},
        "contact": [LINE],
    }
    return Problem(**(given | data))


def partly_open() -> Problem:
    """Problem B: a block on a block, pressed on half of its top; the other half lifts off."""
    steel = Elastic(E=1000.0, nu=0.3)
    return Problem(
        geometry=blocks(line=((0, 0), (2, 0))),
        materials={"upper": steel, "lower": steel},
        displacement={"bottom": (0, 0), "upper_left|lower_left": (0, None)},
        traction={"top": ng.IfPos(1 - ng.x, 1.0, 0.0)},
        contact=[LINE],
    )


def pressed_disc() -> Problem:
    return Problem(
        geometry=disc_on_block(),
        materials={"disc": SOFT, "block": STIFF},
        displacement={"block_bottom": (0, 0), "disc_top": (0, -0.02)},
        sliding="axis",
        traction={"side": (0.001, -0.002)},
        force={"block": (0.0, -0.001), "disc": (0.002, 0.003)},
        contact=[Contact("disc_arc", "block_top", direction=(0, -1))],
    )


def stack() -> Problem:
    """Three blocks: a on a support, b on a, c on b; c is pressed off its middle."""

    def block(name, low, high):
        corners = [(-1.0, low), (1.0, low), (1.0, high), (-1.0, high)]
        sides = ["below", "right", "above", "left"]
        return body(name, polygon(corners, [f"{name}_{side}" for side in sides]))

    return Problem(
        geometry=compound(block("a", 0, 1), block("b", 1, 1.5), block("c", 1.5, 2.5)),
        materials={"a": SOFT, "b": STIFF, "c": SOFT},
        displacement={"a_below": (0, 0)},
        sliding="b_left|c_left",
        traction={"c_above": (0.0, -0.1 * (1 + ng.x))},
        force={"b": (0, -0.05)},
        contact=[
            Contact("b_below", "a_above"),
            Contact("c_below", "b_above", direction=(0, -1)),
        ],
    )


PROBLEMS = {
    "S1": lambda: cases.one_transition().problem,
    "S3": lambda: cases.hertz_contact().problem,
    "S7": lambda: cases.clamped_transition().problem,
    "S8": lambda: cases.curved_lines().problem,
    "S9": lambda: cases.ring_in_ring().problem,
    "polygon": lambda: cases.polygonal_patch().problem,
    "B": partly_open,
    "disc": pressed_disc,
    "stack": stack,
}
SIDES = {  # boundaries of supports by body, and the pairs with the sign of their force on it
    "S1": {"upper": ("top|upper_.*", {0: 1}), "lower": ("bottom|lower_.*", {0: -1})},
    "S3": {"upper": ("top|upper_.*", {0: -1}), "lower": ("bottom|lower_.*", {0: 1})},
    "S7": {"upper": ("top|upper_.*", {0: 1}), "lower": ("bottom|lower_.*", {0: -1})},
    "S9": {"inner": ("inner_.*|hole", {0: -1}), "outer": ("outer_.*|rim", {0: 1})},
    "B": {"upper": ("top|upper_.*", {0: 1}), "lower": ("bottom|lower_.*", {0: -1})},
    "stack": {
        "a": ("a_.*", {0: -1}),
        "b": ("b_.*", {0: 1, 1: -1}),
        "c": ("c_.*", {1: 1}),
    },
}


def values(solution):
    return solution.displacement.vec.FV().NumPy()


def nodes_on(solution, pattern):
    """Positions and displacements at the nodes of a boundary, segment by segment."""
    trace = solution.discrete.space.trace
    segment, s = trace.at_nodes(trace.segments(pattern))
    return trace.point(segment, s), trace.evaluate(solution.displacement, segment, s)


def difference(first, second):
    """Largest difference of two displacements on one mesh, relative to the largest value."""
    return np.abs(values(first) - values(second)).max() / np.abs(values(second)).max()


@pytest.mark.parametrize("order", [1, 4])
@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.study(witness=["B-1", "B-4", "S9-4", "stack-1"])
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
    boundaries = np.array(solution.mesh.GetBoundaries())
    for body_name, (pattern, pairs) in SIDES.get(name, {}).items():
        loads = np.zeros(2)
        for axis, direction in enumerate(((1, 0), (0, 1))):
            unit = ng.GridFunction(solution.displacement.space)
            unit.Set(ng.CF(direction), definedon=solution.mesh.Materials(body_name))
            loads[axis] = solution.discrete.space.f @ unit.vec.FV().NumPy()
        names = set(boundaries[boundary_mask(solution.mesh, pattern)]) & set(solution.reactions)
        reaction = sum((solution.reactions[n] for n in names), np.zeros(2))
        contact = sum(sign * solution.contact_force(pair) for pair, sign in pairs.items())
        assert np.abs(loads + reaction + contact).max() < EXACT * size


def test_the_contact_force_pushes_the_secondary_off_the_primary():
    problem = two_blocks(traction={"top": 0.1})
    assert solve(problem, maxh=0.5).contact_force() == pytest.approx([0, 0.2], abs=1e-13)
    swapped = replace(problem, contact=[Contact("lower_contact", "upper_contact")])
    assert solve(swapped, maxh=0.5).contact_force() == pytest.approx([0, -0.2], abs=1e-13)


def test_uniform_pressure_in_units_of_stress():
    # Uniform pressure 0.1 over all of the width: displacement, stress and pressure by hand.
    problem = two_blocks(
        materials={"upper": SOFT, "lower": SOFT},
        displacement={"bottom": (None, 0)},
        sliding="upper_left|lower_left",
        traction={"top": 0.1},
    )
    for model, across, along in (
        ("plane strain", 1 - 0.3**2, 0.3 * 1.3),
        ("plane stress", 1.0, 0.3),
    ):
        solution = solve(replace(problem, model=model), maxh=0.5, order=2)
        assert solution.pressure == pytest.approx(0.1)
        x, u = nodes_on(solution, "upper_.*|lower_.*|top")
        assert u[:, 0] == pytest.approx(0.1 * along * (x[:, 0] + 1), abs=1e-14)
        assert u[:, 1] == pytest.approx(-0.1 * across * (x[:, 1] + 1), abs=1e-14)
        stress = np.array(ng.Integrate(solution.stress, solution.mesh)) / 4
        assert stress == pytest.approx(np.array([0, 0, 0, -0.1]), abs=1e-14)


@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize("name", ["S1", "S7", "S9", "B", "polygon"])
@pytest.mark.study(witness=["S9-1", "B-1", "S9-3"])
def test_secondary_and_primary_may_be_swapped_on_matched_lines(name, order):
    problem = PROBLEMS[name]()
    [contact] = problem.contact
    solution = solve(problem, maxh=0.3, order=order)
    swapped = replace(problem, contact=[Contact(contact.primary, contact.secondary)])
    assert difference(solve(swapped, solution.mesh, order=order), solution) < 1e-9


def test_a_turned_problem_has_the_turned_solution():
    """An inclined direction, an inclined guide and inclined contact lines."""
    angle = 0.4
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, -sin], [sin, cos]])
    straight = two_blocks(
        displacement={"bottom": (0, 0), "top": (0, -0.02)},
        sliding="upper_left|lower_left",
        contact=[
            Contact("lower_contact", "upper_contact", direction=(0, 1), gap=lambda x, y: x**2 / 10)
        ],
    )
    shape = straight.geometry.shape.Rotate(Axis(Point(0, 0, 0), Vec(0, 0, 1)), math.degrees(angle))
    turned = replace(
        straight,
        geometry=OCCGeometry(shape, dim=2),
        displacement={"bottom": (0, 0), "top": (0.02 * sin, -0.02 * cos)},
        contact=[
            Contact(
                "lower_contact",
                "upper_contact",
                direction=(-sin, cos),
                gap=lambda x, y: (cos * x + sin * y) ** 2 / 10,
            )
        ],
    )
    one, other = (solve(problem, maxh=0.3, order=2) for problem in (straight, turned))
    # The meshes agree to the accuracy of netgen's points, 1e-9.
    assert one.mesh.nv == other.mesh.nv
    assert other.energy == pytest.approx(one.energy, rel=1e-7)
    assert other.contact_force() == pytest.approx(turn @ one.contact_force(), rel=1e-7)
    assert other.transitions() == pytest.approx(one.transitions() @ turn.T, abs=1e-6)
    for name, force in one.reactions.items():
        assert other.reactions[name] == pytest.approx(turn @ force, abs=1e-8)


@pytest.mark.parametrize(("length", "modulus"), [(1e-9, 1e9), (1e9, 1e-9), (1e-6, 1e9)])
def test_units_scale_out(length, modulus):
    """Lengths times one factor, moduli times another: the same contact, to round-off."""

    def pressed(length, modulus):
        mesh = ng.Mesh(one_mesh.ngmesh.Copy())
        mesh.ngmesh.Scale(length)
        x = ng.x / length
        return Problem(
            geometry=mesh,
            materials={
                "upper": Elastic(E=modulus, nu=0.3),
                "lower": Elastic(E=3 * modulus, nu=0.2),
            },
            displacement={"bottom": (0, 0), "top": (None, -0.02 * length * (1 + x))},
            sliding="upper_left",
            traction={"upper_right": 0.01 * modulus * (1 + x)},
            force={"upper": (0.0, -0.01 * modulus / length)},
            contact=[
                Contact(
                    "lower_contact",
                    "upper_contact",
                    direction=(0, 1),
                    gap=0.02 * length * x * x,
                )
            ],
        )

    one_mesh = first_mesh(two_blocks(), 0.4)
    one, other = (solve(pressed(*u), order=2) for u in ((1.0, 1.0), (length, modulus)))
    assert (other.active == one.active).all()
    assert 0 < np.count_nonzero(one.active) < len(one.active)
    assert other.steps == one.steps
    assert np.abs(other.pressure / modulus - one.pressure).max() < 1e-11 * one.pressure.max()
    assert np.abs(values(other) / length - values(one)).max() < 1e-11 * np.abs(values(one)).max()
    assert other.energy == pytest.approx(modulus * length**2 * one.energy, rel=1e-11)
    # Located on gap^(2/3), which magnifies the round-off of small gaps.
    assert other.transitions() == pytest.approx(length * one.transitions(), rel=1e-7)
    assert max(other.residuals.values()) < EXACT


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
    problem = Problem(
        geometry=rings(quarter=True),
        materials={"inner": STIFF, "outer": SOFT},
        sliding="inner_cut_x|inner_cut_y|outer_cut_x|outer_cut_y|rim",
        traction={"hole": 0.1 * (1 + ng.x)},
        contact=[Contact("outer_contact", "inner_contact")],
    )
    solution = solve(problem, maxh=0.4, order=order)
    x, u = nodes_on(solution, "rim")
    assert np.abs(u).max() > 1e-5
    # Not in the mesh's normals: nodes lie on the circle, so that x / 2 is the exact one.
    assert np.abs((u * x).sum(axis=1)).max() < 1e-13 * np.abs(u).max()
    assert max(solution.residuals.values()) < EXACT


@pytest.mark.parametrize(
    ("order", "unknowns", "force", "peak", "width", "energy"),
    [
        (2, 2500, 2e-4, 5e-3, 2e-3, 2e-4),
        (3, 3600, 2e-5, 2e-4, 1e-3, 1e-5),
    ],
)
def test_problem_a(order, unknowns, force, peak, width, energy):
    """A disc on a plane: references of forces, peak, half-width and energy to six digits."""
    problem = Problem(
        geometry=disc(),
        materials={"disc": Elastic(E=200.0, nu=0.3)},
        displacement={"top": (None, -0.005)},
        sliding="axis",
        contact=[Contact("arc", direction=(0, -1), gap=ng.y)],
    )
    *_, solution = adapt(problem, order=order, max_dofs=unknowns)
    resultant = solution.contact_force()
    assert resultant[0] == pytest.approx(0, abs=1e-15)
    assert 2 * resultant[1] == pytest.approx(0.4465326, rel=force)
    assert solution.pressure.max() == pytest.approx(5.5919, rel=peak)
    assert solution.points[solution.pressure.argmax()] == pytest.approx([0, 0], abs=0.01)
    [end] = solution.transitions()
    assert end[0] == pytest.approx(0.05082, rel=width)
    assert solution.energy == pytest.approx(5.221032e-4, rel=energy)


@pytest.mark.parametrize(
    ("order", "unknowns", "energy", "end", "peak"),
    [(2, 2500, 2e-4, 2e-3, 5e-3), (3, 4100, 3e-5, 5e-4, 3e-4)],
)
def test_problem_b(order, unknowns, energy, end, peak):
    """Strain energy 7.164124(1)e-4, end of contact x = 1.5453(1), peak 0.97572(2), force 1."""
    *_, solution = adapt(partly_open(), order=order, max_dofs=unknowns)
    u = values(solution)
    strain = u @ (solution.discrete.space.A @ u) / 2
    assert strain == pytest.approx(7.164124e-4, rel=energy)
    assert solution.energy == pytest.approx(-strain, rel=EXACT)  # homogeneous data
    [place] = solution.transitions()
    assert place == pytest.approx(np.array([1.5453, 0]), rel=end, abs=1e-14)
    largest = solution.pressure.argmax()
    assert solution.pressure[largest] == pytest.approx(0.97572, rel=peak)
    assert solution.points[largest] == pytest.approx([0, 0], abs=1e-14)
    # The load's jump at x = 1 is a node of these meshes: integrated exactly.
    assert solution.contact_force() == pytest.approx([0, 1], abs=1e-12)


READ = {
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
