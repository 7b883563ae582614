"""Numerical stability: a table of cases under stress, with what passes and what fails.

    python -m drivers.stress
    python -m drivers.stress held algebra
    python -m drivers.stress scenes --scenes 600
    python -m drivers.stress data --scenes 200

The exit status is 1 if a case fails.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator, Sequence
from typing import Literal, TypeAlias, get_args

from drivers.command_line import Count, Seed, run
from drivers.stress import Outcome
from ngcontact import ContactError

Trial: TypeAlias = Literal["algebra", "data", "held", "scenes"]
RANDOM = ("algebra", "data", "scenes")  # whose cases are drawn
SCENES = 66  # every kind six times, in two minutes


def line(outcome: Outcome) -> str:
    """One line of the table."""
    return (
        f"{outcome.case:32} {outcome.varied:44} {outcome.steps:5d} {outcome.residual:9.1e} "
        f"{outcome.error:9.1e} {outcome.allowed:9.1e} {'pass' if outcome.passed else 'FAIL'}"
    )


def outcomes(name: Trial, seed: int, scenes: int = SCENES) -> Iterator[Outcome]:
    """Outcomes of one module, which is loaded only now; `scenes` of them where scenes are drawn.

    The module's summary of drawn scenes is printed at the end.
    """
    trial = importlib.import_module(f"drivers.stress.trials.{name}")
    given = {"seed": seed} if name in RANDOM else {}
    if not hasattr(trial, "summary"):
        yield from trial.outcomes(**given)
        return
    found = []
    for outcome in trial.outcomes(**given, count=scenes):
        found.append(outcome)
        yield outcome
    print(*trial.summary(found), sep="\n")


def main(
    trials: Sequence[Trial] = get_args(Trial), *, seed: Seed = 0, scenes: Count = SCENES
) -> int:
    """Numerical stability: a table of cases under stress, with what passes and what fails.

    Prints of each case the Newton steps, the worst residual of the optimality conditions, the error
    against a reference and the error allowed, all dimensionless. All of it takes minutes. The exit
    status is 1 if a case fails.

    Parameters
    ----------
    trials : sequence of str
        Kinds of stress.
    seed : int
        Number from which quadratic programs of `algebra` are drawn; of the first of `data` and
        `scenes`.
    scenes : int
        How many random scenes `data` and `scenes` draw each, of seeds one after the other.

    Returns
    -------
    int
        Number of cases that fail.
    """
    failed = count = 0
    print(f"{'case':32} {'varied':44} {'steps':>5} {'residual':>9} {'error':>9} {'allowed':>9}")
    for name in trials:
        try:
            for outcome in outcomes(name, seed, scenes):
                count += 1
                failed += not outcome.passed
                print(line(outcome), flush=True)
        except ContactError as error:  # the rest of a module falls with a case that raises
            count, failed = count + 1, failed + 1
            print(f"{name:32} {type(error).__name__}: {error} FAIL", flush=True)
    print(f"{count} cases, {failed} failed")
    return failed


if __name__ == "__main__":
    sys.exit(min(run(main), 1))
