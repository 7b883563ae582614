"""Docstrings as a user meets them.

Types lead to where they are documented, `ngcontact.solution.Solution` to `ngcontact.Solution`;
those of other libraries lose their modules. What only the package makes shows no parameters. Bars
are absolute values, not the substitutions of reStructuredText.
"""

from __future__ import annotations

import re

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

FOREIGN = re.compile(r"~?\b(?:(?!ngcontact)\w+\.)+(?=\w)")
SEVERAL = re.compile(r"^:(ivar|vartype) (\w+(?:, \w+)+):(.*\n(?:[ \t]+.*\n)*)", re.MULTILINE)
MADE_BY_USERS = {"Problem", "Contact", "Elastic", "Hooke"}


def _documented(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.TextElement
) -> nodes.reference | None:
    """The reference to a class that is named by another module than the reference names it by."""
    target = node.get("reftarget", "")
    if node.get("reftype") != "class" or not target:
        return None
    python = env.get_domain("py")
    ending = "." + target.rpartition(".")[2]
    listed = (entry[0] for entry in python.get_objects() if entry[-1] > 0)  # no second names
    known = [name for name in listed if f".{name}".endswith(ending)]
    if len(known) != 1:
        return None
    return python.resolve_xref(env, node["refdoc"], app.builder, "obj", known[0], node, content)


def _without_parameters(
    app: Sphinx, what: str, name: str, obj: object, options: object, signature: str, returns: str
) -> tuple[str, None] | None:
    made = what == "class" and name.rpartition(".")[2] not in MADE_BY_USERS
    return ("", None) if made else None


def _as_meant(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Bars are bars, and "value, error : float" are two entries, not one of a type "value,"."""
    text = re.sub(r"(``.*?``)|\|", lambda m: m.group(1) or r"\|", "\n".join(lines))
    lines[:] = SEVERAL.sub(_each, text).split("\n")


def _each(entry: re.Match[str]) -> str:
    """An entry of several names as one for each."""
    return "".join(f":{entry[1]} {name}:{entry[3]}" for name in entry[2].split(", "))


def _short_types(app: Sphinx, domain: str, kind: str, content: nodes.Element) -> None:
    """Drop the modules of others where types stand in fields of their own."""
    for field in content.findall(nodes.field):
        if re.match(r"(type|rtype)\b", field[0].astext()):
            for text in list(field[1].findall(nodes.Text)):
                text.parent.replace(text, nodes.Text(FOREIGN.sub("", text.astext())))


def setup(app: Sphinx) -> dict[str, bool]:
    """Listen."""
    app.connect("missing-reference", _documented)
    app.connect("autodoc-process-signature", _without_parameters)
    app.connect("autodoc-process-docstring", _as_meant)  # after napoleon
    app.connect("object-description-transform", _short_types, priority=900)  # after autodoc's
    return {"parallel_read_safe": True, "parallel_write_safe": True}
