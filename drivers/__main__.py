"""The drivers, with a line on each."""

from __future__ import annotations

import ast
from pathlib import Path

from drivers.command_line import run


def drivers() -> dict[str, str]:
    """First lines of the docstrings of all modules that can be run, without running them."""
    folder = Path(__file__).parent
    files = {path.parent.name: path for path in folder.glob("*/__main__.py")}
    files |= {path.stem: path for path in folder.glob("[a-z]*.py")}
    found = {}
    for name, path in sorted(files.items()):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if any(isinstance(x, ast.FunctionDef) and x.name == "main" for x in tree.body):
            found[name] = (ast.get_docstring(tree) or "").partition("\n")[0]
    return found


def main() -> dict[str, str]:
    """Print the drivers, with a line on each; ``--help`` of a driver lists its parameters.

    Returns
    -------
    dict of str
        First line of the docstring by name of the driver.
    """
    found = drivers()
    width = max(map(len, found))
    for name, line in found.items():
        print(f"python -m drivers.{name:{width}}  {line}")
    print(f"\n{'--help':{width + 18}}  parameters of a driver, their units and defaults")
    return found


if __name__ == "__main__":
    run(main)
