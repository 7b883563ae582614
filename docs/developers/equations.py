"""The functions that implement the equations of HH81, from the comments at their lines.

``python docs/developers/equations.py`` writes ``equations.md``. A comment names what its line, or
the line below it, implements: ``# (2.10)``, ``# HH81 (2.3), (2.5)``, ``# Remark 3.7``; a range such
as ``(3.9)-(3.12)`` names all of it.
"""

from __future__ import annotations

import ast
import re
import tokenize
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from io import StringIO
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PAGE = HERE / "equations.md"

# What the paper states, in its order; (2.1), (3.3), (3.4) and the proofs have no code.
STATED = {
    "(2.2)": "V_h on polygons: linear on triangles",
    "(2.3)": "K_h on a polygonal contact line: nᵢ·(v′ - v″) ≤ 0 at its nodes, two rows at a corner",
    "(2.4)": "V_h on curved elements: linear in physical coordinates",
    "(2.5)": "K_h on a curved contact line: n·(v′ - v″) ≤ 0 at its nodes",
    "(2.6)": "total potential energy L(v)",
    "(2.7)": "ellipticity of c_ijkl",
    "(2.8)": "functions mapped by F_T: Zlámal's curved elements",
    "(2.9)": "V_h of mapped functions",
    "(2.10)": "K_εh: v″_ξ(B_j) - v′_ξ(A_j) ≤ ε(C_j) on the common division {C_j}",
    "(3.1)": "A(u, v)",
    "(3.2)": "f(v)",
    "(3.5)": "equilibrium in the bodies: τ_ij,j + F_i = 0",
    "(3.6)": "u = 0 on Γ_u",
    "(3.7)": "τ_ij n_j = P_i on Γ_τ",
    "(3.8)": "u_n = 0, T_t = 0 on Γ_0",
    "(3.9)": "u′_n + u″_n ≤ 0 on Γ_K",
    "(3.10)": "T′_n = T″_n ≤ 0 on Γ_K",
    "(3.11)": "T_t = 0 on Γ_K",
    "(3.12)": "T_n (u′_n + u″_n) = 0 on Γ_K",
    "(3.9')": "u″_ξ - u′_ξ ≤ ε",
    "(3.10')": "-T′_ξ / cos α′ = T″_ξ / cos α″ ≤ 0",
    "(3.11')": "T_η = 0",
    "(3.12')": "T″_ξ (u″_ξ - u′_ξ - ε) = 0",
    "Remark 3.3": "bilateral contact",
    "Remark 3.7": "motions left free: equilibrium of the load, one condition in the mean",
}

NAME = re.compile(r"\([23]\.\d{1,2}['′]?\)|Remark [23]\.\d+")
LAYOUT = {tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}
RANGE = re.compile(rf"({NAME.pattern})\s*[-–]\s*({NAME.pattern})")


@dataclass(frozen=True)
class Place:
    """A function of the package: file below the repository, qualified name."""

    path: str
    function: str


def named(text: str) -> set[str]:
    """Equations and remarks that a text names, ranges in full."""
    order = list(STATED)
    found = {name.replace("′", "'") for name in NAME.findall(text)}
    for first, last in RANGE.findall(text.replace("′", "'")):
        if first in STATED and last in STATED:
            found.update(order[order.index(first) : order.index(last) + 1])
    return found


def _functions(source: str) -> list[tuple[int, int, str]]:
    """First line, last line and qualified name of each function and class, outer ones first."""
    found = []

    def visit(node: ast.AST, outer: str) -> None:
        for child in ast.iter_child_nodes(node):
            name = outer
            if isinstance(child, ast.FunctionDef | ast.ClassDef):
                name = f"{outer}.{child.name}".lstrip(".")
                first = min([child.lineno, *(d.lineno for d in child.decorator_list)])
                found.append((first, child.end_lineno or child.lineno, name))
            visit(child, name)

    visit(ast.parse(source), "")
    return found


def comments(source: str) -> Iterator[tuple[int, str]]:
    """Comments, with the number of the line of code that each belongs to."""
    waiting: list[str] = []
    for token in tokenize.generate_tokens(StringIO(source).readline):
        if token.type == tokenize.COMMENT and not token.line[: token.start[1]].strip():
            waiting.append(token.string)
        elif token.type == tokenize.COMMENT:
            yield token.start[0], token.string
        elif token.type not in LAYOUT:
            yield from ((token.start[0], comment) for comment in waiting)
            waiting = []


@cache
def places() -> dict[str, list[Place]]:
    """Functions of the package with a comment that names an equation, once each, by equation."""
    found: dict[str, dict[Place, None]] = defaultdict(dict)
    for path in sorted((ROOT / "ngcontact").rglob("*.py")):
        source = path.read_text()
        functions = _functions(source)
        for line, comment in comments(source):
            around = [name for first, last, name in functions if first <= line <= last]
            file = path.relative_to(ROOT).as_posix()
            for name in named(comment):
                found[name][Place(file, around[-1] if around else "module")] = None
    return {name: list(where) for name, where in found.items()}


def _row(name: str, meaning: str, where: list[Place]) -> str:
    links = [f"[{p.path.removeprefix('ngcontact/')}](../../{p.path}) `{p.function}`" for p in where]
    return f"| {name} | {meaning} | {'<br>'.join(links)} |"


def page() -> str:
    """The index as Markdown."""
    found = places()
    rows = [_row(name, meaning, found.get(name, [])) for name, meaning in STATED.items()]
    return "\n".join(
        [
            "# Equation index",
            "",
            "What J. Haslinger and I. Hlaváček (1981) state, and the functions that implement",
            "it: a comment in each names the equation at its line.",
            "Made by `python docs/developers/equations.py`; the symbols are those of",
            "[notation](../notation.md).",
            "",
            "| HH81 | states | where |",
            "|---|---|---|",
            *rows,
            "",
        ]
    )


def main() -> None:
    """Write the page."""
    PAGE.write_text(page())


if __name__ == "__main__":
    main()
