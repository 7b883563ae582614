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


def test_forms_of_comments(equations):
    assert equations.named("# (2.10)") == {"(2.10)"}
    assert equations.named("# HH81 (2.3), (2.5): rows") == {"(2.3)", "(2.5)"}
    assert equations.named("# Remark 3.7, (3.12')") == {"Remark 3.7", "(3.12')"}
    assert equations.named("# (3.9)-(3.11)") == {"(3.9)", "(3.10)", "(3.11)"}
    assert equations.named("# the pair (2.0, 3.5), version 2.10") == set()


def test_line_of_a_comment_is_that_of_its_code(equations):
    source = "x = 1  # (2.2)\n\n# (2.3)\n# and on\n@cache\ndef f():\n    # (2.4)\n\n    return 2\n"
    lines = [(line, text) for line, text in equations.comments(source) if "(2" in text]
    assert lines == [(1, "# (2.2)"), (5, "# (2.3)"), (9, "# (2.4)")]
