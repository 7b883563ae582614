"""The picture of the house shows today's imports, and both walks go the way that the code goes."""

import inspect
import re
import sys
from contextlib import contextmanager
from itertools import islice, pairwise

import pytest
from PIL import Image

from ngcontact import Contact, Elastic, Problem, adapt, solve
from ngcontact.geometries import disc_on_block
from tests.docs.names import resolved

NEW = "run python docs/developers/architecture.py"


@pytest.fixture
def architecture(script):
    return script("architecture")


def test_every_room_has_a_floor(architecture):
    assert not architecture.rooms_without_floor()
    assert architecture.upwards(architecture.imports()) == []


def test_picture_shows_the_imports_of_today(architecture):
    drawn = Image.open(architecture.PICTURE).text["Imports"]
    assert drawn.split("\n") == architecture.as_text(architecture.imports()).split("\n"), NEW


def test_page_lists_the_imports_of_today(architecture):
    text = architecture.PAGE.read_text()
    assert architecture.page(text, architecture.imports()) == text, NEW


def reached(room, edges):
    """Rooms below a room, over any number of imports."""
    return edges[room].union(*(reached(other, edges) for other in edges[room]))


def test_arrows_left_out_follow_from_others(architecture):
    edges = architecture.imports()
    drawn = architecture.without_detours(edges)
    assert {room: reached(room, drawn) for room in edges} == {r: reached(r, edges) for r in edges}


def test_ways_that_go_on_are_left_out(architecture):
    edges = {"top": {"middle", "low"}, "middle": {"low"}, "low": set()}
    assert architecture.without_detours(edges) == {
        "top": {"middle"},
        "middle": {"low"},
        "low": set(),
    }


def test_no_arrow_crosses_a_box(script):
    drawing = script("drawing")
    storeys = drawing.Storeys([["a", "b"], ["c"], ["d", "e"]], {"a": {"d", "c"}, "b": {"e"}})
    storeys.sort()
    x = storeys.places()
    assert storeys.crossings() == 0
    for row in storeys.rows:
        for left, right in pairwise(row):
            width = sum(drawing.LANE if ">" in name else drawing.WIDTH for name in (left, right))
            assert x[right] - x[left] - width / 2 > 0.999 * drawing.SPACE  # as solve_qp rounds


# The walks.


@contextmanager
def recorded(calls):
    """Append the code of every Python function called."""

    def note(frame, event, arg):
        if event == "call":
            calls.append(frame.f_code)

    sys.setprofile(note)
    try:
        yield
    finally:
        sys.setprofile(None)


def walk(architecture, name):
    """The functions of a walk of the page, in order."""
    [section] = re.findall(
        rf"^## A `Problem` walks through `{name}`\n(.*?)^## ",
        architecture.PAGE.read_text(),
        re.DOTALL | re.MULTILINE,
    )
    steps = re.findall(r"^\| \d+ \| `([\w.]+)` \|", section, re.MULTILINE)
    assert len(steps) > 10
    return steps


def press():
    """A disc on a block: two bodies, supports, an enlarging zone."""
    steel = Elastic(E=210e9, nu=0.3)
    return Problem(
        geometry=disc_on_block(radius=1.0),
        materials={"disc": steel, "block": steel},
        displacement={"block_bottom": (0, 0), "disc_top": (0, -0.002)},
        sliding="axis",
        contact=[Contact(secondary="disc_arc", primary="block_top", direction=(0, -1))],
    )


@pytest.mark.parametrize("name", ["solve", "adapt"])
def test_walk_goes_the_way_of_the_code(architecture, name):
    steps, problem, calls = walk(architecture, name), press(), []
    with recorded(calls):
        if name == "solve":
            solve(problem, maxh=0.4, order=2)
        else:
            list(islice(adapt(problem, maxh=0.4, order=2), 2))
    way = iter(calls)
    met = [step for step in steps if inspect.unwrap(resolved(step)).__code__ in way]
    assert met == steps
