"""Every equation of the theory stands at a line of the code, and the index shows which."""

from pathlib import Path

import pytest

THEORY = (Path(__file__).parents[2] / "docs" / "theory.md").read_text()


@pytest.fixture
def equations(script):
    return script("equations")


def test_every_equation_of_the_theory_is_in_the_code(equations):
    named = equations.named(THEORY)
    assert len(named) > 15
    missing = sorted(named - equations.places().keys())
    assert not missing, f"no line of ngcontact has a comment that names {', '.join(missing)}"


def test_comments_name_equations_of_the_paper(equations):
    unknown = {n: p for n, p in equations.places().items() if n not in equations.STATED}
    assert not unknown, "not among docs/developers/equations.py: STATED"


def test_index_is_of_today(equations):
    assert equations.PAGE.read_text() == equations.page(), "run python docs/developers/equations.py"
