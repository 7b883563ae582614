"""Warnings of data: loads that are nowhere, or too fine."""

import warnings
from dataclasses import replace

import ngsolve as ng
import pytest

from ngcontact import ContactWarning, solve
from tests.quadrature.test_loads import box, loaded


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
