"""Contact lines: gaps next to zero, corners, ends, waves, and stretched elements along them.

Errors are compared with what the mesh can do: order 1 reproduces a constant pressure, and the error
of S1 and S3 is bounded by that of the interpolant. The latter needs no constant: the interpolant
lies in K_h and has the values of u_h on Gamma_u, so that L(u_h) <= L(Iu) gives

    |u - u_h|^2 <= |u - Iu|^2 + 2 integral of p (gap(Iu) - gap(u_h)).

At order 1 the difference of the gaps is at most the interpolant of the gap of u, which vanishes
wherever p does not when nodes lie at the ends of the contact. Interference is in test_fits.py,
corners where contact ends in tests/contact/test_state.py.
"""

import math
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from drivers.reference.cases import BLOCKS, FIRST, OUTSIDE, SECOND
from drivers.reference.straight import hertz, patch, relative_energy_error, transition
from drivers.reference.westergaard import effective_modulus, moduli
from ngcontact import Contact, Problem, adapt, solve
from ngcontact.geometries import blocks
from ngcontact.geometries.region import compound
from tests.given_meshes import structured
from tests.scenes import rectangle

RESIDUAL = 1e-10  # of the optimality conditions, dimensionless; round-off leaves 1e-16 to 1e-12
TINY = 1e-12  # gaps, in units of the bodies' size 1
ROUND_OFF = 1e-14  # of displacements of the size 0.1: a hundred last bits
PATCH = 1e-9  # of exactly represented stresses, resultants and pressures


def solved(problem, mesh=None, **options):
    """A solution that is optimal."""
    solution = solve(problem, mesh, **options)
    assert max(solution.residuals.values()) <= RESIDUAL
    return solution


def moved(first, second):
    """Largest difference of the displacement coefficients on equal meshes."""
    u, v = (s.displacement.vec.FV().NumPy() for s in (first, second))
    return float(np.abs(u - v).max())


def over_the_best(solution, exact):
    """Error in energy over that of the interpolant of the exact displacement."""
    u = ng.GridFunction(solution.displacement.space)
    u.Set(solution.mesh.MaterialCF(exact.displacement), dual=True)
    best = relative_energy_error(replace(solution, displacement=u), exact)
    return relative_energy_error(solution, exact) / best


def touching(mesh, exact, where=OUTSIDE):
    """Blocks without gap, the exact displacement given outside, or at top and bottom."""
    u = {where[name]: u for name, u in exact.displacement.items()}
    return cases.touching_blocks(u, geometry=mesh, force=exact.force)


# --- gaps next to zero, and contact without strict complementarity ---


@pytest.mark.parametrize("direction", [None, (0.0, -1.0)])
@pytest.mark.parametrize("base", [0.0, 1000.0])
def test_last_bits_of_drawn_gaps(base, direction):
    """One last bit of the coordinates, and +-1e-12: no more than the gap, as they hold it."""

    def pressed(gap):
        pair = Contact("upper_contact", "lower_contact", direction=direction)
        down = {"top": (0, -0.1), "bottom": (0, 0)}
        upper = ("upper_contact", "side", "top", "side")
        drawn = compound(
            rectangle("upper", (-1, 1), (base + gap, base + 1), upper),
            rectangle(
                "lower", (-1, 1), (base - 1, base), ("bottom", "side", "lower_contact", "side")
            ),
        )
        problem = cases.touching_blocks(down, geometry=drawn, contact=[pair])
        return solved(problem, maxh=0.25, order=2)

    bit, zero = float(np.spacing(base + 1.0)), pressed(0.0)
    for gap in (bit, -bit, TINY, -TINY):
        assert moved(pressed(gap), zero) <= abs(gap) + bit + ROUND_OFF


# --- corners, ends and waves of the line ---


@pytest.mark.study(witness=["0.0004-1", "0.1-2"])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-4, 4e-4, 6e-4, 1e-3, 1e-2, 0.1, 1.0])
def test_uniform_stress_across_a_corner(size, order):
    """The stress -I across lines with one corner: displacement, resultant and pressure."""
    template, right = cases.polygonal_patch(), 0.73  # 1 to the left, so that segments differ
    exact = template.exact.displacement["upper"]
    for slope in (math.tan(size / 2), -math.tan(size / 2)):
        line = [(-1.0, -slope), (0.0, 0.0), (right, -right * slope)]
        s = solved(replace(template.problem, geometry=blocks(line=line)), maxh=0.4, order=order)
        off, whole = (
            ng.Integrate(ng.InnerProduct(v, v), s.mesh) ** 0.5
            for v in (s.displacement - exact, exact)
        )
        assert off <= PATCH * whole
        assert np.abs(s.contact_force() - ((right - 1) * slope, 1 + right)).max() <= PATCH
        assert np.abs(s.pressure - 1).max() <= PATCH


@pytest.mark.parametrize("order", [1, 2, 3])
def test_contact_up_to_sides_of_any_kind(order):
    """Free, prescribed and guided sides of the bodies, exact at every order."""
    free = patch(FIRST, SECOND)
    ends = {"top": free.displacement["upper"], "bottom": free.displacement["lower"]}
    prescribed = {OUTSIDE[name]: u for name, u in free.displacement.items()}
    left, right = "upper_left|lower_left", "upper_right|lower_right"
    squeezed, held = {}, {}
    for (name, material), end in zip(BLOCKS.items(), ("top", "bottom"), strict=True):
        m = moduli(material)
        stiff = m.lam + 2 * m.mu
        held[end] = (None, -ng.y / stiff)
        squeezed[name] = ng.CF((-m.lam / stiff, 0, 0, -1), dims=(2, 2))
    guided = replace(free, stress=squeezed)
    for exact, displacement, sliding in (
        (free, ends, None),
        (free, prescribed, None),
        (guided, held, f"{left}|{right}"),
        (guided, held | {left: (0, None)}, right),
    ):
        s = solved(cases.touching_blocks(displacement, sliding=sliding), maxh=0.25, order=order)
        assert relative_energy_error(s, exact) <= PATCH
        assert np.abs(s.pressure - 1).max() <= PATCH


@pytest.mark.study
@pytest.mark.parametrize(
    ("waves", "maxh", "order", "most"), [(8, 0.3, 4, 15_000), (64, 0.1, 2, 20_000)]
)
def test_waves_that_the_first_mesh_does_not_see(waves, maxh, order, most):
    """Blocks 0 <= x <= 1 with the gap A (1 - cos), guided on the sides: all crests touch.

    On each with the half-width of a tenth of a wavelength L. H. M. Westergaard 1939: with
    q = sin^2(pi / 10) the mean pressure is q pi E* A / L. Contact closes the mean gap by
    A (q - q ln q): the integral of its derivative -A ln q, the compliance of the row of contacts.
    """
    amplitude, height, q = 0.01 / waves, 0.5, math.sin(math.pi / 10) ** 2
    mean = q * math.pi * effective_modulus(FIRST, SECOND) * 0.01
    compliance = sum(height / (m.lam + 2 * m.mu) for m in map(moduli, BLOCKS.values()))
    depth = mean * compliance + amplitude * (q - q * math.log(q))
    gap = amplitude * (1 - ng.cos(2 * math.pi * waves * ng.x))
    problem = Problem(
        geometry=blocks(line=((0, 0), (1, 0)), height=height),
        materials=BLOCKS,
        displacement={"top": (None, -depth), "bottom": (None, 0)},
        sliding="upper_left|upper_right|lower_left|lower_right",
        contact=[Contact("upper_contact", "lower_contact", direction=(0, -1), gap=gap)],
    )
    *_, s = adapt(problem, maxh=maxh, order=order, max_dofs=most)
    assert len(s.transitions()) == 2 * waves
    # 1e-3 and 2e-3 measured at these numbers of unknowns.
    assert abs(np.abs(s.contact_force()[1]) / mean - 1) <= 1e-2


# --- stretched elements: aspect ratios up to 1e4, angles of 0.1 and 179 degrees ---

CELLS = 8  # along x and y of each block; a node at the end of the contact, x = 0
HALF_WIDTH = 2 / CELLS  # of the contact of S3, between two nodes


def meshes():
    """Mesh, aspect ratio and slenderness of stretched meshes and of those with a sliver."""
    x, y = np.linspace(-1, 1, CELLS + 1), np.linspace(0, 1, CELLS + 1)
    for factor in (1e2, 1e3, 1e4):
        # Narrow columns about the end of the contact, and thin layers along the contact.
        half = np.concatenate([[0.0], np.geomspace(1 / (CELLS * factor), 1, 12)])
        columns = np.union1d(np.concatenate([-half[:0:-1], half]), [-2 * HALF_WIDTH])
        layers = np.concatenate([[0.0], np.geomspace(1 / (CELLS * factor), 1, CELLS)])
        yield structured(columns, y), factor, False
        yield structured(x, layers), factor, False
        yield structured(x / factor, y), factor, True
        yield structured(x, y / factor), factor, False
    dx, dy = x[1] - x[0], y[1] - y[0]

    def moving(corner, to):
        return lambda a, b: to if np.allclose((a, b), corner) else (a, b)

    # One extreme triangle at the end of the contact: the apex of that on 0 <= x <= dx is lowered,
    # or the contact segment that starts at x = 0 is shortened.
    for angle in (179.0, 179.8):  # the second one has two angles of 0.1 degrees
        flat = moving((dx, dy), (dx / 2, dx / 2 / math.tan(math.radians(angle / 2))))
        yield structured(x, y, flat), 1.0, False
    needle = moving((dx, 0.0), (dy * math.tan(math.radians(0.1)), 0.0))
    yield structured(x, y, needle), 1.0, False


@pytest.mark.study(witness=["1-0", "2-14"])
@pytest.mark.parametrize("number", range(15))
@pytest.mark.parametrize("order", [1, 2])
def test_errors_follow_the_interpolation_error(order, number):
    """Constant pressure, one transition and Hertz contact on all meshes."""
    mesh, aspect, slender = list(meshes())[number]
    uniform, parting = patch(FIRST, SECOND), transition(FIRST, SECOND)
    # A slender body is held at its sides too: its bending is as soft as 1 / aspect^2.
    where = OUTSIDE if slender else {"upper": "top", "lower": "bottom"}
    s = solve(touching(mesh, uniform, where), order=order)
    assert relative_energy_error(s, uniform) <= PATCH
    # Forces are what is left of terms of size E aspect times the displacement, at nodes whose share
    # of the boundary is 1 / aspect: known to eps aspect^2.
    assert np.abs(s.pressure - 1).max() <= max(PATCH, np.finfo(float).eps * aspect**2)
    # Over the best, order 1: 1 by the theory above. Order 2: 0.15 to 0.95 measured.
    assert over_the_best(solve(touching(mesh, parting), order=order), parting) <= 1.0
    if not slender:
        pressing = hertz(FIRST, SECOND, radius=5.0, half_width=HALF_WIDTH)
        there = ng.Mesh(mesh.ngmesh.Copy())  # the contact ends where it did at x = 0
        there.ngmesh.Coordinates()[:, 0] += HALF_WIDTH
        contact = Contact("lower_contact", "upper_contact", (0, 1), gap=pressing.initial_gap)
        s = solve(replace(touching(there, pressing), contact=[contact]), order=order)
        assert over_the_best(s, pressing) <= 1.0
