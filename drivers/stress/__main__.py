"""Table of all stress cases; the exit status is 1 if one fails.

    python -m drivers.stress [name ...]

with the names of modules, such as ``held`` or ``scaling``, runs only these.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys

from drivers.stress import Outcome, trials
from ngcontact import ContactError


def line(outcome: Outcome) -> str:
    """One line of the table."""
    return (
        f"{outcome.case:32} {outcome.varied:44} {outcome.steps:5d} {outcome.residual:9.1e} "
        f"{outcome.error:9.1e} {outcome.allowed:9.1e} {'pass' if outcome.passed else 'FAIL'}"
    )


def modules() -> list[str]:
    """Names of all modules with cases."""
    return sorted(m.name for m in pkgutil.iter_modules(trials.__path__) if m.name[0] != "_")


def main(names: list[str]) -> int:
    """Print the table of the modules `names`, of all of them without names."""
    failed = count = 0
    print(f"{'case':32} {'varied':44} {'steps':>5} {'residual':>9} {'error':>9} {'allowed':>9}")
    for name in names or modules():
        try:
            for outcome in importlib.import_module(f"drivers.stress.trials.{name}").outcomes():
                count += 1
                failed += not outcome.passed
                print(line(outcome), flush=True)
        except ContactError as error:  # the rest of a module falls with a case that raises
            count, failed = count + 1, failed + 1
            print(f"{name:32} {type(error).__name__}: {error} FAIL", flush=True)
    print(f"{count} cases, {failed} failed")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
