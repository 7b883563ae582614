"""Docstrings as a user meets them.

Types lead to the public names, `ngcontact.solution.Solution` to `Solution`. What only the package
makes shows no parameters. Bars are absolute values, not the substitutions of reStructuredText.
"""

from __future__ import annotations

import re

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

import ngcontact

MADE_BY_USERS = {"Problem", "Contact", "Elastic", "Hooke"}


def _public(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.TextElement
) -> nodes.reference | None:
    """The reference to a public class or function that is named by the module that defines it."""
    name = node.get("reftarget", "").rpartition(".")[2]
    if node.get("refdomain") != "py" or name not in ngcontact.__all__:
        return None
    python = env.get_domain("py")
    target = f"ngcontact.{name}"
    return python.resolve_xref(env, node["refdoc"], app.builder, "obj", target, node, content)


def _without_parameters(
    app: Sphinx, what: str, name: str, obj: object, options: object, signature: str, returns: str
) -> tuple[str, None] | None:
    made = what == "class" and name.rpartition(".")[2] not in MADE_BY_USERS
    return ("", None) if made else None


def _absolute_values(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    lines[:] = [re.sub(r"(``.*?``)|\|", lambda m: m.group(1) or r"\|", line) for line in lines]


def setup(app: Sphinx) -> dict[str, bool]:
    """Listen."""
    app.connect("missing-reference", _public)
    app.connect("autodoc-process-signature", _without_parameters)
    app.connect("autodoc-process-docstring", _absolute_values)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
