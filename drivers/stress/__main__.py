"""Numerical stability: a table of cases under stress, with what passes and what fails.

    python -m drivers.stress
    python -m drivers.stress scenes --scenes 600
    python -m drivers.stress data --scenes 200

The exit status is 1 if a case fails.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Literal, TypeAlias, get_args

from drivers.command_line import Count, Seed, run
from drivers.stress import Outcome, data
from drivers.stress.scenes import judging
from ngcontact import ContactError

Trial: TypeAlias = Literal["data", "scenes"]
TRIALS = {"data": data, "scenes": judging}
SCENES = 66  # every kind six times, in two minutes


def line(outcome: Outcome) -> str:
    """One line of the table."""
    return (
        f"{outcome.case:32} {outcome.varied:44} {outcome.steps:5d} {outcome.residual:9.1e} "
        f"{outcome.error:9.1e} {outcome.allowed:9.1e} {'pass' if outcome.passed else 'FAIL'}"
    )


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
        Number of the first scene.
    scenes : int
        How many random scenes each kind draws, of seeds one after the other.

    Returns
    -------
    int
        Number of cases that fail.
    """
    failed = count = 0
    print(f"{'case':32} {'varied':44} {'steps':>5} {'residual':>9} {'error':>9} {'allowed':>9}")
    for name in trials:
        trial, found = TRIALS[name], list[Outcome]()
        try:
            for outcome in trial.outcomes(seed, scenes):
                found.append(outcome)
                print(line(outcome), flush=True)
            print(*trial.summary(found), sep="\n")
        except ContactError as error:  # the rest of a module falls with a case that raises
            count, failed = count + 1, failed + 1
            print(f"{name:32} {type(error).__name__}: {error} FAIL", flush=True)
        count, failed = count + len(found), failed + sum(not outcome.passed for outcome in found)
    print(f"{count} cases, {failed} failed")
    return failed


if __name__ == "__main__":
    sys.exit(min(run(main), 1))
