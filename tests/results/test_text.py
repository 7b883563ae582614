"""Problems and solutions as short tables."""

import re

import ngsolve as ng
import numpy as np
import pytest

from ngcontact import Contact, Elastic, Hooke, Problem
from ngcontact.geometries import blocks
from ngcontact.problem.values import told


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "free"),
        (0.25, "0.25"),
        (ng.CF(-2e9), "-2e+09"),
        (ng.CF((0.1, -3.0)), "(0.1, -3)"),
        ((ng.CF(0.5), None), "(0.5, free)"),
        (ng.CF(0.0), "0"),
        (ng.CF((0, 0)), "(0, 0)"),
        (ng.CF((0, -2.0)), "(0, -2)"),
        (ng.x * 2, "function"),
        (ng.CF((ng.x, 1.0)), "function"),
        (2 * ng.CF(3.0) + ng.Parameter(1.0), "function"),
        (lambda x, y: x, "function"),
    ],
)
def test_values_in_a_few_characters(value, text):
    assert told(value) == text


def cells(html):
    return re.findall(r"<t[dh]>(.*?)</t[dh]>", html)


def problem():
    return Problem(
        geometry=blocks(),
        materials={"upper": Elastic(1.0, 0.3), "lower": Hooke(np.diag([2.0, 2.0, 0.5]))},
        displacement={"bottom": (0, 0), "top": (None, -0.1)},
        sliding="upper_left",
        force={"upper": (0, ng.x)},
        traction={"lower_left": 0.5, "upper_right": (1.0, 0.0)},
        contact=[Contact("upper_contact", "lower_contact", gap=0.01, bilateral=True)],
    )


def test_a_problem_shows_all_of_its_data():
    html = problem()._repr_html_()
    assert len(html) < 1500
    shown = cells(html)
    for text in (
        *("plane strain", "E = 1, nu = 0.3", "(0, 0)", "(free, -0.1)", "upper_left"),
        *("function", "pressure 0.5", "(1, 0)", "along the normal, gap 0.01, bilateral"),
        "C = (2, 0, 0), (0, 2, 0), (0, 0, 0.5)",
        "&quot;upper_contact&quot; with &quot;lower_contact&quot;",
    ):
        assert text in shown
