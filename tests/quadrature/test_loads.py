"""Loads that quadrature misses: found, integrated, told; integrals with a measured error."""

import math
import warnings
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest
from ngsolve.meshes import MakeStructured2DMesh

from ngcontact import ContactWarning, Elastic, Problem, solve
from ngcontact.fem.space import LOAD_BONUS, load_vector
from ngcontact.geometries.region import compound
from ngcontact.quadrature import SampledElements, rough_load
from tests.scenes import rectangle


def square():
    return compound(rectangle("body", (0, 1), (0, 1), ("bottom", "right", "top", "left")))


def loaded(**data):
    return Problem(
        geometry=square(),
        materials={"body": Elastic(1.0, 0.3)},
        displacement={"bottom": (0, 0)},
        **data,
    )


def box(x, start, width):
    return ng.IfPos(x - start, ng.IfPos(start + width - x, 1.0, 0.0), 0.0)


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("start", [0.1, 0.333, 0.5, 0.6180339, 0.987])
def test_a_narrow_strip_of_pressure_is_not_lost(start, order):
    # Width .01, total 1, on the first mesh: the force was 0. Parts are halved to 1e-6 of the load.
    problem = loaded(traction={"top": 100 * box(ng.x, start, 0.01)})
    force = solve(problem, maxh=1 / 8, order=order).reactions["bottom"]
    assert force == pytest.approx([0, 1], abs=2e-5)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_a_narrow_strip_about_an_axis_does_its_work(order):
    """On the displacement r^p, of which 2 pi r v has a degree more."""
    a, b = 0.3, 0.31
    data = {"materials": {".*": Elastic(1.0, 0.3)}, "displacement": {"bottom": (0, 0)}}
    load = {"top": ng.CF((0, box(ng.x, a, b - a)))}
    mesh = MakeStructured2DMesh(quads=False, nx=2, ny=1)
    problem = Problem(mesh, **data, traction=load, model="axisymmetric")
    V = ng.VectorH1(mesh, order=order)
    v = ng.GridFunction(V)
    v.Set(ng.CF((0, ng.x**order)))
    work = load_vector(problem, V, LOAD_BONUS) @ v.vec.FV().NumPy()
    k = order + 2
    expected = 2 * math.pi * (b**k - a**k) / k
    assert work == pytest.approx(expected, rel=1e-4)  # parts are halved to 1e-6 of the whole load


@pytest.mark.parametrize(
    ("x", "y"),
    # Of the last two a part of 1 % lay between the points beside those that saw the rest.
    [(0.533, 0.621), (0.05, 0.97), (0.25, 0.25), (0.884, 0.583), (0.871, 0.11)],
)
def test_a_small_patch_of_body_force_is_not_lost(x, y):
    inside = ng.IfPos(0.005**2 - (ng.x - x) ** 2 - (ng.y - y) ** 2, 1.0, 0.0)
    problem = loaded(force={"body": (0, -1e4 * inside)})
    force = solve(problem, order=2).reactions["bottom"]
    assert force[1] == pytest.approx(1e4 * math.pi * 0.005**2, rel=1e-3)


@pytest.mark.parametrize("start", [0.0, 0.3, 0.96, 0.962])
def test_narrow_loads_on_two_triangles_are_not_lost(start):
    """No point of a lattice need be in them; from .96 on what is left beside a layer is narrow."""
    problem = loaded(
        traction={"top": 1000 * box(ng.x, start, 1e-3)},
        force={"body": (0, -100 * box(ng.y, start, 0.01))},
    )
    force = solve(problem, maxh=1.0, order=2).reactions["bottom"]
    # A layer along sides of the parts, of a hundredth: measured 1.6e-2, where it was lost 1 and 6.
    assert force == pytest.approx([0, 2], abs=3e-2)


@pytest.mark.parametrize("outside", [0.0, -1.0])
@pytest.mark.parametrize("start", [-3e-4, -1e-4, 1e-4, 5e-4])
@pytest.mark.parametrize("end", [-5e-4, 1e-4, 3e-4, 5.7e-4])
def test_a_strip_that_ends_beside_vertices_is_not_lost(start, end, outside):
    """On segments of half its width: of one that reaches into a third no point need tell."""
    mesh = MakeStructured2DMesh(quads=False, nx=200, ny=2)
    a, b = 0.3 + start, 0.31 + end
    load = ng.IfPos(ng.x - a, ng.IfPos(b - ng.x, 1.0, 0.0), outside)
    top = mesh.Boundaries("top")
    rough = rough_load(ng.CF((0, load)), top, 3)
    usual = np.array(ng.Integrate(load, mesh, definedon=top, element_wise=True))
    found = ng.Integrate(rough.projection[1], mesh, ng.BND, definedon=top, element_wise=True)
    total = np.where(rough.rough, found, usual).sum()
    # Up to 5 % of the strip was lost. Parts are halved to 1e-6 of the load's size.
    assert total == pytest.approx(b - a + a * outside, abs=2e-6 * (b - a - a * outside))


@pytest.mark.parametrize("nx", [10, 100])
def test_loads_that_jump_along_edges_are_left_to_the_usual_rule(nx):
    """It is exact for them: no part of an element is on the other side."""
    mesh = MakeStructured2DMesh(quads=False, nx=nx, ny=nx)
    load = ng.IfPos(ng.x - 0.3, (1 + ng.x * ng.y) * ng.x**2, -7.0)
    assert rough_load(load, mesh.Materials(".*"), 3) is None
    assert rough_load(ng.CF((load, 0)), mesh.Boundaries("top"), 3) is None


@pytest.mark.parametrize(("unit", "load"), [(1e-9, 1.0), (1.0, 1e-200), (1e9, 1.0)])
def test_rough_loads_in_any_unit(unit, load):
    """On a given mesh: the geometry kernel has neither of these lengths."""
    mesh = MakeStructured2DMesh(quads=False, nx=8, ny=8, mapping=lambda x, y: (unit * x, unit * y))
    strip = ng.CF((0, load * box(ng.x / unit, 0.4, 0.01)))
    rough = rough_load(strip, mesh.Boundaries("top"), 3)
    projection = rough.projection
    total = ng.Integrate(projection[1], mesh, ng.BND, definedon=mesh.Boundaries("top"))
    assert total == pytest.approx(0.01 * load * unit, rel=1e-4)
    # It vanishes but on the strip: |P|^2 = |Pi P|^2 + |P - Pi P|^2.
    inside = ng.Integrate((projection[1] / load) ** 2, mesh, ng.BND, order=8)
    rest = ((rough.projection_error / load) ** 2).sum()
    assert inside + rest == pytest.approx(0.01 * unit, rel=1e-4)


def test_a_load_that_is_nowhere():
    problem = loaded(traction={"top": 1e9 * box(ng.x, 0.1234567, 1e-9)})
    with pytest.warns(ContactWarning, match='traction "top" is zero at all'):
        solve(problem, maxh=0.3)


def test_a_load_finer_than_any_quadrature():
    problem = loaded(traction={"top": ng.IfPos(ng.sin(1e7 * ng.x), 1.0, 0.0)})
    with pytest.warns(ContactWarning, match='traction "top" is finer than any quadrature'):
        solve(problem, maxh=0.3)


def test_sound_data_are_no_doubt():
    data = {"bottom": (0, 0), "left": (0, 0.1 * ng.y), "top": (None, 0.1)}
    with warnings.catch_warnings():
        warnings.simplefilter("error", ContactWarning)
        solve(replace(loaded(force={"body": (0, ng.x)}), displacement=data), maxh=0.3)


MESH = MakeStructured2DMesh(quads=False, nx=5, ny=5)
INSIDE = ng.IfPos(0.3**2 - (ng.x - 0.47) ** 2 - (ng.y - 0.51) ** 2, 1.0, 0.0)
FAR = ng.IfPos(ng.x - 0.41, (ng.x - 0.41) ** 2, 0.0)


def over(mesh, function, dim):
    view = SampledElements(mesh, dim)
    region = mesh.Materials(".*") if dim == 2 else mesh.Boundaries("bottom")
    [value], [error] = view.integral(function, view.inside(region))
    return value, error


@pytest.mark.parametrize(
    ("function", "dim", "value"),
    [
        (ng.exp(ng.x + 2 * ng.y), 2, (math.e - 1) * (math.e**2 - 1) / 2),
        (INSIDE, 2, math.pi * 0.3**2),
        (FAR, 2, 0.59**3 / 3),  # begins in corners of elements that have no point of a rule there
        (FAR, 1, 0.59**3 / 3),
        (ng.sqrt(ng.sqrt((ng.x - 0.33) ** 2)), 1, (0.33**1.5 + 0.67**1.5) / 1.5),
        (1 / ng.sqrt(ng.x), 1, 2.0),
        pytest.param(ng.IfPos(ng.x - 0.337, 1.0, -1.0), 1, 1 - 2 * 0.337, id="jump"),
    ],
)
@pytest.mark.parametrize("unit", [1e-150, 1.0, 1e150])
@pytest.mark.study(witness=["1.0-jump", "1e-150-jump", "1e+150-jump"])
def test_the_error_is_not_more_than_is_measured(function, dim, value, unit):
    found, error = over(MESH, ng.CF(unit) * function, dim)
    assert abs(found / unit - value) <= error / unit + 1e-14 * abs(value)
    # Of jumps along curves and infinite functions, halved while points differ, measured 4e-6.
    assert error / unit < 1e-5
