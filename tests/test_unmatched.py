"""Scenes on which rows at single nodes went wrong without a word, each against what is known."""

from __future__ import annotations

import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import Compound, OCCGeometry, WorkPlane, Y

from ngcontact import Contact, Elastic, Problem
from ngcontact.mesh import first_mesh
from tests.scenes import distance, solved_with_load

EXACT = 1e-10  # round-off times the condition of small meshes
LAW = Elastic(E=1.0, nu=0.3)
UNIFORM = (0.3 * 1.3 * ng.x, -(1 - 0.3**2) * ng.y)  # plane strain under -1 along y


def rectangle(name, x, y):
    """A body between x[0], x[1] and y[0], y[1]; its boundaries are name_top, _bottom, _side."""
    face = WorkPlane().MoveTo(x[0], y[0]).Rectangle(x[1] - x[0], y[1] - y[0]).Face()
    face.faces.name = name
    face.edges.name = f"{name}_side"
    face.edges.Max(Y).name, face.edges.Min(Y).name = f"{name}_top", f"{name}_bottom"
    return face


def over_a_slot(width, middle, pairs):
    """A plate on two blocks, 0 < x < 1, with a slot between them; uniform pressure 1."""
    slot = middle - width / 2, middle + width / 2
    bodies = [
        rectangle("plate", (0, 1), (0, 0.5)),
        rectangle("a", (0, slot[0]), (-0.5, 0)),
        rectangle("b", (slot[1], 1), (-0.5, 0)),
    ]
    problem = Problem(
        geometry=OCCGeometry(Compound(bodies), dim=2),
        materials={"plate|a|b": LAW},
        displacement={"plate_top|a_bottom|b_bottom": UNIFORM},
        contact=[Contact(*pair) for pair in pairs],
    )
    return problem, slot


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("primaries", [["a_top|b_top"], ["a_top", "b_top"]])
def test_a_slot_of_any_width_leaves_pressures_right(order, swap, primaries):
    """Nodes at one end of a narrow slot only, at both of a wide one, inside the widest."""
    pairs = [("plate_bottom", name)[:: -1 if swap else 1] for name in primaries]
    for width in (1e-6, 1e-3, 6e-3, 3e-2, 1e-1):
        problem, slot = over_a_slot(width, 0.47, pairs)
        mesh = first_mesh(problem, 0.2)
        d, result = solved_with_load(problem, mesh, order, "plate_bottom", [slot])
        weight = np.concatenate([line.weight for line in d.lines])
        np.testing.assert_allclose(result.force / weight, 1.0, rtol=EXACT)
        assert distance(d, result, UNIFORM) < EXACT
