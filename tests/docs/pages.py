"""The pages as they lie: their tables of contents, and the Python in them."""

import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import get_type_hints

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
_FENCE = re.compile(
    r"^(?P<indent> *)```(?P<info>[^\n`]*)\n(?P<body>.*?)^(?P=indent)```$", re.MULTILINE | re.DOTALL
)


@dataclass(frozen=True)
class Block:
    """Python in a page: `code` from `line` on."""

    page: str
    line: int
    code: str
    cell: bool
    quiet: bool = False

    def __str__(self) -> str:
        """As an editor opens it."""
        return f"{self.page}:{self.line}"


def blocks(page: str, text: str) -> Iterator[Block]:
    """All Python of a page, in order."""
    for fence in _FENCE.finditer(text):
        info = fence["info"].strip()
        cell = info.startswith("{code-cell}")
        if cell or re.match(r"(python|py|pycon|ipython)\b", info):
            body = textwrap.dedent(fence["body"])
            options = re.match(r"(?::[\w-]+:.*\n)*", body).group()
            line = text.count("\n", 0, fence.start("body")) + options.count("\n") + 1
            yield Block(page, line, body[len(options) :], cell, "remove-stderr" in options)


def resolved(name: str) -> object:
    """Module, function, class or attribute of `ngcontact` by its dotted name below it."""
    found: object = import_module("ngcontact")
    for part in name.split("."):
        if isinstance(found, property):
            found = get_type_hints(found.fget)["return"]
        module = f"{getattr(found, '__name__', '')}.{part}"
        if hasattr(found, "__path__") and find_spec(module):
            found = import_module(module)
        else:
            fields = getattr(found, "__dataclass_fields__", {})
            found = fields[part] if part in fields else getattr(found, part)
    return found
