"""Every warning of the package stands in docs/problem.md with what to do, and none that is gone."""

import ast
import re

from tests.docs.pages import ROOT

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


def test_every_warning_has_a_row_and_every_row_is_said():
    assert len(WARNED) >= 7
    assert not [row for row in ROWS if not any(says(row, text) for text in EVERY)]
    assert not [text for text in WARNED if not any(says(row, text) for row in ROWS)]
