"""Every warning of the package stands in docs/problem.md with what to do, and none that is gone."""

import ast
import re

import pytest

from tests.docs.docstrings import ROOT

PAGE = (ROOT / "docs" / "problem.md").read_text()
[TABLE] = re.findall(r"^\| it says \|.*\n\|[-|]+\n((?:\|.*\n)+)", PAGE, re.MULTILINE)
ROWS = [line.split("|")[1].strip() for line in TABLE.splitlines()]


def fixed(node):
    """The fixed parts of a string with values in it."""
    parts = node.values if isinstance(node, ast.JoinedStr) else [node]
    return "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in parts)


def texts():
    """Strings of the package, and those of them that stand in a call of `warn`."""
    every, warned = [], []
    for path in (ROOT / "ngcontact").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.JoinedStr):
                every.append(fixed(node))
            match node:
                case ast.Call(func=ast.Name(id="warn"), args=[ast.JoinedStr() as message]):
                    warned.append(fixed(message))
                case ast.Return(value=ast.Constant(value=str(message))):
                    every.append(message)
    return every, warned


EVERY, WARNED = texts()


def says(row, text):
    """Whether a message has the words of a row, "..." standing for anything."""
    return all(words in text for words in row.split(" ... "))


@pytest.mark.parametrize("row", ROWS)
def test_a_row_is_said(row):
    assert any(says(row, text) for text in EVERY)


@pytest.mark.parametrize("text", WARNED)
def test_what_is_said_has_a_row(text):
    assert any(says(row, text) for row in ROWS)


def test_warnings_are_found():
    assert len(WARNED) >= 7
    assert says("is zero ... points", '{} "{}" is zero at all {} points')
    assert not says("is zero ... points", "is zero")
