"""Warnings point at the caller's line."""

from pathlib import Path
from typing import Any

import pytest

from ngcontact import ContactWarning, errors
from ngcontact.errors import warn


def test_a_warning_names_the_line_outside_of_the_package():
    with pytest.warns(ContactWarning, match="may be wrong") as caught:
        warn("this may be wrong")
    assert Path(caught[0].filename) == Path(__file__)


def test_a_generator_warns_at_the_line_that_asks_for_its_next_value():
    source = "def levels():\n    warn('of a level')\n    yield 1\n"
    room: dict[str, Any] = {"warn": warn}
    exec(compile(source, errors.PACKAGE + "adaptive.py", "exec"), room)
    levels = room["levels"]()
    with pytest.warns(ContactWarning) as caught:
        next(levels)
    assert Path(caught[0].filename) == Path(__file__)
