"""Contact between bodies of very different stiffness: the softer one hosts the rows."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Contact, ConvergenceError, Elastic, Problem, solve
from ngcontact.geometries import punch

PAIR = ("punch_contact", "foundation_contact")


def pressed(contrast: float, pair: tuple[str, str] = PAIR, **loads: object) -> Problem:
    """Flat punch, `contrast` times stiffer than its foundation."""
    problem = replace(cases.flat_punch(), geometry=punch(width=20.0, depth=20.0), **loads)
    materials = {**problem.materials, "punch": Elastic(E=contrast, nu=0.3)}
    return replace(problem, materials=materials, contact=[Contact(*pair)])


@pytest.mark.parametrize("pair", [PAIR, PAIR[::-1]])
@pytest.mark.parametrize("contrast", [1e8, 1e10, 1e12, 1e14])
def test_the_force_on_a_stiff_punch_is_that_on_a_rigid_one(
    contrast: float, pair: tuple[str, str]
) -> None:
    rigid = solve(pressed(1e7), maxh=2.0, order=2)
    stiff = solve(pressed(contrast, pair), maxh=2.0, order=2)
    force, expected = abs(stiff.contact_force()[1]), abs(rigid.contact_force()[1])
    # The punch of the comparison gives way by 1e-7 of the foundation.
    assert force == pytest.approx(expected, rel=1e-6)
    pressure, same = (s.pressure[np.argsort(s.points[:, 0])] for s in (stiff, rigid))
    # Likewise; measured 1.6e-7.
    np.testing.assert_allclose(pressure, same, rtol=1e-6)


def test_a_stiff_punch_held_by_contact_alone_is_right_or_refused() -> None:
    loads = {"displacement": {"foundation_bottom": (0, 0)}, "traction": {"punch_top": 0.01}}
    solution = solve(pressed(1e6, **loads), maxh=2.0, order=2)
    # The load is 0.01 times the length 1. Round-off of the stiffer body, 1e6 eps, some tens of
    # times: measured 4e-9.
    assert solution.contact_force()[1] == pytest.approx(0.01, rel=1e-7)
    with pytest.raises(ConvergenceError, match="moduli"):
        solve(pressed(1e12, **loads), maxh=2.0, order=2)
