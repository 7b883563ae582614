"""Pages made from the source are of today: rooms, their walks, equations at lines of the code."""

import inspect
import re
from importlib import import_module
from itertools import islice

import pytest
from PIL import Image

from drivers.reference import cases
from ngcontact import adapt, solve
from tests.docs.pages import DOCS, resolved
from tests.runs import recorded

NEW = "run python docs/developers/architecture.py"


@pytest.fixture
def script(monkeypatch):
    """A script of docs/developers by its name."""
    monkeypatch.syspath_prepend(DOCS / "developers")
    return import_module


@pytest.fixture
def architecture(script):
    return script("architecture")


def test_picture_shows_the_imports_of_today(architecture):
    drawn = Image.open(architecture.PICTURE).text["Imports"]
    assert drawn.split("\n") == architecture.as_text(architecture.imports()).split("\n"), NEW


def test_page_lists_the_imports_of_today(architecture):
    text = architecture.PAGE.read_text()
    assert architecture.page(text, architecture.imports()) == text, NEW


@pytest.mark.parametrize("name", ["solve", "adapt"])
def test_walk_goes_the_way_of_the_code(architecture, name):
    """The functions of a walk of the page are called, in order."""
    [section] = re.findall(
        rf"^## A `Problem` walks through `{name}`\n(.*?)^## ",
        architecture.PAGE.read_text(),
        re.DOTALL | re.MULTILINE,
    )
    steps = re.findall(r"^\| \d+ \| `([\w.]+)` \|", section, re.MULTILINE)
    assert len(steps) > 10
    problem = cases.pressed_disc()
    with recorded() as calls:
        if name == "solve":
            solve(problem, maxh=0.4, order=2)
        else:
            list(islice(adapt(problem, maxh=0.4, order=2), 2))
    way = iter(calls)
    assert [step for step in steps if inspect.unwrap(resolved(step)).__code__ in way] == steps


THEORY = (DOCS / "theory.md").read_text()


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
