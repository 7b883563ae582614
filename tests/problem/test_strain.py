"""Initial strains that a problem refuses, and how it keeps them."""

import math
import pickle
import warnings
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from ngcontact import ContactWarning, Elastic, Hooke, Problem, adapt, solve
from ngcontact.geometries import blocks, sleeve_on_shaft
from ngcontact.problem import numbers

LAW = Elastic(E=1.0, nu=0.3)


def strained(strain, law=LAW, **data):
    return Problem(blocks(), {"upper|lower": law}, strain=strain, **data)


def revolved(strain):
    return Problem(
        sleeve_on_shaft(), {"shaft|sleeve": LAW}, strain={"shaft": strain}, model="axisymmetric"
    )


@pytest.mark.parametrize(
    ("value", "error", "told"),
    [
        ("hot", TypeError, r'strain "upper" = \'hot\': give a real number'),
        (True, TypeError, 'strain "upper" = True'),
        (math.nan, ValueError, 'strain "upper" = nan: give a finite number'),
        ((1e-3, math.inf), ValueError, 'strain "upper" = inf'),
        ((1e-3,), ValueError, "give a number, which acts in all three directions, a pair"),
        ((1e-3,) * 4, ValueError, "a pair"),
        (((1e-3, 0), 0), ValueError, "symmetric matrix"),
        (((1e-3, 0, 0),) * 3, ValueError, "symmetric matrix"),
        (ng.CF((1, 2, 3, 4)), ValueError, r"dims \(4,\)"),
        (ng.CF(1e-3 * 1j), TypeError, "complex"),
    ],
)
def test_values_that_are_refused(value, error, told):
    with pytest.raises(error, match=told):
        strained({"upper": value})


@pytest.mark.parametrize(
    ("problem", "told"),
    [
        (strained({"uper": 1e-3}), 'strain "uper" selects no region; did you mean "upper"'),
        (strained({"upper": 1e-3, "upper|lower": 0.0}), "give every region once"),
        (strained({"upper": ng.sqrt(-1 - ng.x)}), "must be finite"),
        (strained({"upper": ng.log(ng.y)}), "must be finite"),  # on the line y = 0 alone
        (strained({"upper": ((0.0, 1e-3), (2e-3, 0.0))}), "symmetric, xy = yx"),
        (strained({"upper": 1e-3}, Hooke(np.eye(3))), r"give the pair \(xx, yy\)"),
        (strained({"upper": (0.0, 0.0, 1e-3)}, Hooke(np.eye(3))), "normal to the plane"),
        (revolved((1e-3, 0.0)), 'strain "shaft" has rr - hoop or rz = 0.001 on'),
        (revolved(((0.0, 1.0), (1.0, 0.0))), "rz = 1 on the axis"),
    ],
)
def test_strains_that_do_not_fit_a_mesh(problem, told, no_work):
    with pytest.raises(ValueError, match=told):
        solve(problem, maxh=0.5)


@pytest.mark.parametrize("value", [1e-3, (1e-3, 2e-3), (1e-3, 0.0, 1.0), ((1.0, 2.0), (2.0, 3.0))])
def test_strains_are_kept_as_they_are_given(value):
    """So another problem may be made of them, and numbers are known to be numbers."""
    problem = strained({"upper": value})
    again = replace(problem, traction={})
    assert again.strain["upper"] is problem.strain["upper"]
    assert numbers(problem.strain["upper"])
    pickle.loads(pickle.dumps(problem))


def test_functions_that_no_element_follows_are_told():
    ends = {"displacement": {"bottom": (0, 0), "top": (0, 0)}}
    jump = ng.IfPos(ng.x - 0.317, 1e-3, 0.0)
    spot = 1e-3 * ng.exp(-((ng.x - 0.3) ** 2 + (ng.y - 0.5) ** 2) / 0.01**2)
    nothing = 1e-3 * ng.IfPos(1e-4**2 - (ng.x - 0.31) ** 2 - (ng.y - 0.51) ** 2, 1.0, 0.0)
    for strain, told in (
        (jump, 'initial strains of "upper" jump inside'),
        (spot, 'strain "upper" has a feature'),
        (nothing, 'strain "upper" is zero at all'),
    ):
        with pytest.warns(ContactWarning, match=told):
            solution = solve(strained({"upper": strain}, **ends), maxh=0.3, order=2)
        if strain is spot:
            with pytest.raises(ValueError, match="no guaranteed bound"):
                _ = solution.error_bound
    with warnings.catch_warnings():  # refined until its narrow part is seen
        warnings.simplefilter("error", ContactWarning)
        *_, last = adapt(strained({"upper": spot}, **ends), tolerance=0.1)
    assert last.relative_error_bound < 0.1
