"""Moduli that jump, and narrow features of data: told with place and size, or resolved."""

import math
import warnings
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference.laws import fibres
from ngcontact import Contact, ContactWarning, Elastic, Hooke, Problem, adapt, solve
from ngcontact.adaptivity import refined
from ngcontact.fem import warn_of_jumps
from ngcontact.geometries import rings
from ngcontact.mesh import curve, first_mesh
from ngcontact.quadrature import features_of, sample_data, unresolved
from ngcontact.quadrature.cells import lattice
from ngcontact.quadrature.features import steps_along
from tests.fem.test_moduli import BODIES, made_of
from tests.quadrature.test_loads import box, loaded


@pytest.fixture(scope="module")
def mesh():
    return first_mesh(made_of(Elastic(1.0, 0.3)), 0.7)


def functions(first, second):
    """C as a function, of two matrices on both sides of x = .37 + y / 10."""
    side = ng.x - 0.37 - 0.1 * ng.y
    entries = zip(first.ravel().tolist(), second.ravel().tolist(), strict=True)
    return Hooke(ng.CF(tuple(ng.IfPos(side, a, b) for a, b in entries), dims=(3, 3)))


JUMPS = {
    "contrast 3": Elastic(ng.IfPos(ng.x - 0.37 - 0.1 * ng.y, 1.0, 3.0), 0.3),
    "contrast 1e4": Elastic(ng.IfPos(ng.x - 0.37 - 0.1 * ng.y, 1.0, 1e4), 0.3),
    "nu": Elastic(1.0, ng.IfPos(ng.x - 0.37 - 0.1 * ng.y, 0.0, 0.45)),
    # The trace of a law does not depend on the angle of its fibres.
    "axes": functions(*(fibres(100.0, angle, shear=1.0).C for angle in (0.3, -0.3))),
    "beside a smooth change": Elastic(
        (1 + ng.x * ng.x) * ng.IfPos(ng.x - 0.37 - 0.1 * ng.y, 1.0, 20.0), 0.3
    ),
}


@pytest.mark.parametrize("name", JUMPS)
@pytest.mark.parametrize("unit", [1.0, 1e9])
def test_jumps_inside_elements_are_told_with_their_place(name, unit, mesh):
    law = JUMPS[name]
    if unit != 1:
        law = Hooke(unit * law.voigt())
    with pytest.warns(ContactWarning, match="jump inside") as caught:
        warn_of_jumps(made_of(law), mesh)
    assert len(caught) == 2  # one of each body
    for warning, body in zip(caught, BODIES, strict=True):
        message = str(warning.message)
        assert f'"{body}"' in message
        assert "an edge of the geometry" in message
        x, y = map(float, message.split("near (")[1].split(")")[0].split(","))
        assert x == pytest.approx(0.37 + 0.1 * y, abs=1e-3)  # printed with four digits


@pytest.mark.parametrize("length", [1.0, 3000.0])
@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_small_jumps_are_found_beside_large_changes(length, size):
    """Of 1e-3 beside a change of 1, which in 2048 parts bends by 1e-6 from one to the next."""
    place = 0.70710678 * length

    def function(x):
        return np.sin(3 * x / length) + size * (x > place)

    t = np.concatenate([[0.0], length * lattice(1, 2048)[:, 0], [length]])
    at, amount = steps_along(function, t, function(t))
    assert at == pytest.approx([place], rel=1e-12)
    assert amount == pytest.approx([size], rel=1e-9)


PLACES = [0.0, 0.123456, 0.5, 0.6180339]


def bump(x, start, width):
    return box(x, start, width) * ng.sin(math.pi * (x - start) / width) ** 2


def found(problem, kind, maxh=0.3):
    mesh = first_mesh(problem, maxh)
    sample_data(problem, mesh)
    return next(one for one in features_of(problem, mesh) if one.kind == kind and one.samples)


def given(kind, f):
    """A problem with a function of one kind, on the side "top" or in the body."""
    if kind == "traction":
        return loaded(traction={"top": f})
    if kind == "force":
        return loaded(force={"body": (0, f)})
    if kind == "displacement":
        return replace(loaded(), displacement={"bottom": (0, 0), "top": (None, f)})
    if kind == "gap":
        pair = Contact("top", direction=(0, 1), gap=f, bilateral=True)
        return loaded(contact=[pair])
    return replace(loaded(), materials={"body": Elastic(f, 0.3)})


@pytest.mark.parametrize("kind", ["traction", "displacement", "gap"])
@pytest.mark.parametrize("start", PLACES)
@pytest.mark.parametrize("width", [1e-3, 7e-3, 0.05])
def test_a_strip_is_found_with_its_place_and_width(kind, start, width):
    """On a slope that is higher. What is left between it and an end may be told, too."""
    if start == 0 and width > 7e-3:
        start = 0.05  # at an end, half a wave looks the same
    f = 3 * ng.x + box(ng.x, start, width)
    one = found(given(kind, f), kind)
    assert len(one.spots) <= 2
    off = np.linalg.norm(one.spots[:, :2] - [start + width / 2, 1], axis=1)
    assert off.min() < width / 4
    assert one.spots[off.argmin(), 2] == pytest.approx(width, rel=0.25)  # measured: 0.2 at the end


SMOOTH = [
    ng.x,
    1 + ng.sin(3 * ng.x) * ng.cos(20 * ng.y),
    ng.sin(18 * ng.x),
    ng.exp(-(((ng.x - 0.4) / 0.1) ** 2)),
    ng.sqrt((ng.x - 0.3) ** 2),
    (ng.x - 0.4) ** 2,
    ng.IfPos(ng.x - 0.4, 1.0, 2.0),
    ng.cos(27 * ng.x + 2.52),  # turns shortly before an end ...
    ng.cos(29.9 * ng.x + 1.02),  # ... or shortly after
    (ng.x - 0.015) ** 2,  # the same of parabolas
    (ng.x - 0.032) ** 2,
]


@pytest.mark.parametrize("kind", ["traction", "displacement", "gap", "force"])
@pytest.mark.parametrize("number", range(len(SMOOTH)))
def test_slopes_waves_kinks_and_steps_are_no_features(kind, number):
    assert not len(found(given(kind, SMOOTH[number]), kind).spots)


@pytest.mark.parametrize("phase", np.linspace(0, 6, 7))
def test_circles_have_no_ends(phase):
    """As of an oval hole: where the samples began `adapt` saw a feature, and ran on."""
    laws = {".*": Elastic(1.0, 0.3)}
    gap = 1e-3 * (1 + ng.cos(2 * ng.atan2(ng.y, ng.x) - float(phase)))
    for side, other in (("inner_contact", "outer_contact"), ("outer_contact", "inner_contact")):
        held = {"hole": (1e-3, 0), "rim": (0, 0)}
        pair = Contact(side, other, gap=gap)
        assert not len(found(Problem(rings(), laws, held, contact=[pair]), "gap").spots)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_corners_of_the_mesh_of_a_circle_are_no_features(order):
    """`adapt` refined towards all, and no bound was known; a groove on the circle is one."""
    r, groove = ng.sqrt(ng.x**2 + ng.y**2), 1e-4 * ng.exp(-((ng.y / 5e-3) ** 2))
    for gap, count in ((1.05 - r, 0), (1e-3 * (2 - r), 0), (1.05 - r + groove, 2)):
        pair = Contact("inner_contact", gap=gap)
        problem = Problem(rings(), {".*": Elastic(1.0, 0.3)}, contact=[pair])
        mesh, _ = curve(first_mesh(problem, 0.5), order, "isoparametric")
        [one] = features_of(problem, mesh)
        assert len(one.spots) == count


@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize("width", [1e-3, 0.03])
def test_a_strip_on_a_uniform_load_is_carried(order, width):
    """The supports carried half of it; the error was 40 times the bound."""
    problem = loaded(traction={"top": 1 + box(ng.x, 0.38713, width) / width})
    solution = solve(problem, maxh=0.4, order=order)
    assert solution.reactions["bottom"] == pytest.approx([0, 2], abs=1e-5)  # halved to 1e-6 of it
    fine = list(adapt(problem, maxh=0.4, order=4, max_dofs=3000))[-1]
    least = 2 * (solution.energy - fine.energy)  # of |u - u_h|^2: the fine one's energy is higher
    assert solution.error_bound**2 > least
    assert solution.error_estimate**2 > least
    lower, upper = solution.energy_bounds
    assert lower < fine.energy < upper


@pytest.mark.parametrize(
    ("kind", "f", "place"),
    [
        ("displacement", 0.1 * ng.x**2 + 0.01 * bump(ng.x, 0.4, 4e-3), r"\(0\.40\d*, 1\)"),
        ("gap", -0.1 * ng.x**2 - 0.01 * bump(ng.x, 0.4, 4e-3), r"\(0\.40\d*, 1\)"),
        ("materials", 1 - 0.99 * box(ng.y, 0.5, 3e-3), r"\(.*, 0\.5\d*\)"),
    ],
)
def test_data_narrower_than_the_mesh_are_told_and_not_bounded(kind, f, place):
    problem = given(kind, f)
    with pytest.warns(ContactWarning, match=rf"{kind} .* has a feature 0\.00\d+ wide near {place}"):
        solution = solve(problem, maxh=0.3, order=2)
    with pytest.raises(ValueError, match=rf"no guaranteed bound is known where {kind}"):
        _ = solution.error_bound


@pytest.mark.parametrize("kind", ["displacement", "gap"])
def test_adapt_refines_towards_what_is_narrow(kind):
    """The residual does not see it on the first mesh, whose error would meet the tolerance."""
    f = (1 if kind == "displacement" else -1) * 0.01 * (ng.x + bump(ng.x, 0.4, 2e-3))
    problem = given(kind, f)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*has a feature")
        *_, last = adapt(problem, maxh=0.3, order=3, tolerance=0.2, guaranteed=True)
    assert last.relative_error_bound < 0.2
    assert not unresolved(problem, last.mesh, in_bounds=True)
    middle = last.displacement(last.mesh(0.401, 1.0))[1]
    assert abs(middle) == pytest.approx(0.01 * 1.401, rel=0.02)


def test_a_displacement_that_no_node_knows_of():
    """At nodes it is 1e-200, which is no unit of squares; the error is the solution's norm."""
    bump = -0.01 * ng.exp(-(((ng.x - 0.87) / 2e-3) ** 2))
    problem = replace(loaded(), displacement={"bottom": (0, 0), "top": (None, bump)})
    with pytest.warns(ContactWarning, match="has a feature"):
        solution = solve(problem, maxh=0.34)
    *_, fine = adapt(problem, order=2, max_dofs=4000)
    assert solution.energy_norm < 1e-6 * fine.energy_norm
    assert 1 <= solution.error_estimate / fine.energy_norm <= 8  # measured 1.3


SAMPLES = 2048  # on a boundary, for each component


def moved():
    """The square, one side of which is moved by a function."""
    top = (0, 0.1 * ng.sin(ng.x))
    return replace(loaded(), traction={}, force={}, displacement={"bottom": (0, 0), "top": top})


def test_refinement_costs_no_looks():
    """A search on each segment and mesh took 257 points a segment, and 90 for each of its parts."""
    mesh, counts = first_mesh(moved(), 0.25), []
    for _ in range(5):
        counts.append(solve(moved(), mesh, order=2).work["evaluations"])
        mesh = refined(moved(), mesh)
    assert SAMPLES < min(counts)  # one look, and more closely where the slope is extreme
    assert max(counts) <= 1.1 * SAMPLES


def test_parameters_that_change_are_seen_by_the_next_run():
    """The same problem again, of which a parameter has made a function jump."""
    jump = ng.Parameter(0.0)
    top = (0, 0.1 * ng.sin(ng.x) + jump * ng.IfPos(ng.x - 0.3, 1.0, 0.0))
    problem = replace(moved(), displacement={"bottom": (0, 0), "top": top})
    first = solve(problem, maxh=0.25, order=2)
    assert first.error_bound < np.inf
    jump.Set(0.01)
    again = solve(problem, first.mesh, order=2, start=first)
    with pytest.raises(ValueError, match=r'"top" jumps near \(0.3, 1\)'):
        _ = again.error_bound
