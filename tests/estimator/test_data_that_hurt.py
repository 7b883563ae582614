"""Data that meshes do not resolve, three variations each: effectivities against finer solutions."""

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import Glue, OCCGeometry

from drivers.reference.overkill import Overkill
from ngcontact import ContactWarning, Elastic, adapt
from ngcontact.geometries.region import body, compound, polygon
from tests.quadrature.test_loads import box, loaded


def of_levels(problem, order, resolved=None, unknowns=1000):
    """Estimates over errors of the first, middle and last level of a run; its solutions."""
    levels = list(adapt(problem, order=order, max_dofs=unknowns * order))
    shown = [levels[0], levels[len(levels) // 2], levels[-1]]
    # An estimate is 3 to 6 times the error: the finer one's is a third of those it judges.
    for reference in adapt(resolved or problem, order=4, max_dofs=30_000):
        if reference.error_estimate <= 0.1 * shown[-1].error_estimate:
            overkill = Overkill(reference)
            errors = [overkill.relative_error(s) * reference.energy_norm for s in shown]
            if reference.error_estimate < min(errors):
                break
    else:
        pytest.fail("the finer solution is too coarse")
    return [s.error_estimate / error for s, error in zip(shown, errors, strict=True)], levels


def strips(*ends):
    """Unit square whose top is "loaded" between the abscissae of each pair, else "top"."""
    x = [1.0, *sorted((x for pair in ends for x in pair), reverse=True), 0.0]
    names = ["bottom", "right", *["top", "loaded"] * len(ends), "top", "left"]
    vertices = [(0, 0), (1, 0), *((each, 1.0) for each in x)]
    return compound(body("body", polygon(vertices, names)))


def inside(x, y, radius):
    return ng.IfPos(radius**2 - (ng.x - x) ** 2 - (ng.y - y) ** 2, 1.0, 0.0)


PULL = 80 * box(ng.x, 0.31, 0.01) - 80 * box(ng.x, 0.633, 0.01)
LOADS = {
    "two strips that cancel": (
        {"traction": {"top": PULL}},
        {"geometry": strips((0.31, 0.32), (0.633, 0.643)), "traction": {"loaded": PULL}},
        (0, 0),
    ),
    "a strip of shear beside the corner": (
        {"traction": {"top": ng.CF((50 * box(ng.x, 0.987, 0.01), 0))}},
        {"geometry": strips((0.987, 0.997)), "traction": {"loaded": (50, 0)}},
        (0.5, 0),
    ),
}


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", LOADS)
@pytest.mark.study(witness=["a strip of shear beside the corner-1", "two strips that cancel-1"])
def test_loads(name, order):
    data, edges, force = LOADS[name]
    problem = replace(loaded(), **data)
    # Measured 2.8 to 5.1.
    found, levels = of_levels(problem, order, replace(problem, **edges))
    assert min(found) >= 1
    assert found[-1] <= 8
    size = max(np.abs(force).max(), 0.8)
    for solution in levels:
        assert solution.reactions["bottom"] == pytest.approx(-np.array(force), abs=1e-3 * size)


def above_a_line(E):
    """The modulus E above a slanting line, 1 below; the line as an edge."""
    lower = [(0, 0), (1, 0), (1, 0.63), (0, 0.41)]
    upper = [(0, 0.41), (1, 0.63), (1, 1), (0, 1)]
    faces = [
        body("body", polygon(lower, ["bottom", "right", "between", "left"])),
        body("body", polygon(upper, ["between", "right", "top", "left"])),
    ]
    return ng.IfPos(ng.y - 0.41 - 0.22 * ng.x, E, 1.0), OCCGeometry(Glue(faces), dim=2)


JUMPS = {
    "a slanting line, 1e2": above_a_line(1e2),
    "a soft half, 1e-4": above_a_line(1e-4),
}


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", JUMPS)
@pytest.mark.study(witness=["a soft half, 1e-4-1"])
def test_moduli_that_jump_inside_elements(name, order):
    E, edges = JUMPS[name]
    problem = replace(loaded(traction={"top": (0.3, -1.0)}), materials={"body": Elastic(E, 0.3)})
    resolved = replace(problem, geometry=edges)
    with pytest.warns(ContactWarning, match="jump inside"):
        found, levels = of_levels(problem, order, resolved)
    # Measured 1.4 to 75 where a line cuts elements badly.
    assert min(found) >= 1
    assert len(levels) <= 12
    # With edges the data are resolved: measured 2.8 to 4.9.
    found, _ = of_levels(resolved, order)
    assert 1 <= min(found) <= max(found) <= 8
