"""Named failures and warnings; bad input is a `ValueError` or `TypeError`."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Any

PACKAGE = str(Path(__file__).parent / "x")[:-1]  # with the separator


class ContactWarning(UserWarning):
    """A result that may be wrong, and what to do about it."""


def warn(message: str) -> None:
    """Warn, at the line outside of the package that led here.

    Parameters
    ----------
    message : str
        What may be wrong, where, and what to do.
    """
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(PACKAGE):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, ContactWarning, stacklevel=level + 1)


class ContactError(RuntimeError):
    """A well-posed input for which no solution was reached."""


class ConvergenceError(ContactError):
    """The active-set iteration did not settle.

    Parameters
    ----------
    message
        What was iterated, how far it came and what to try.
    iterate
        The last iterate, so that it can be inspected or used as a start.
    """

    def __init__(self, message: str, *, iterate: Any = None) -> None:
        super().__init__(message)
        self.iterate = iterate


class NoEquilibriumError(ContactError):
    """The load drives a rigid motion which neither support nor contact resists (HH81 Rem. 3.7).

    Parameters
    ----------
    message
        The body, the motion, the work and what would hold the body.
    motion
        The rigid motion, of the `bodies` that it names; the first is the error's `body`.
    work
        Work of the load on that motion (any consistent units).
    """

    def __init__(self, message: str, *, motion: Any, work: float) -> None:
        super().__init__(message)
        self.body: str = motion.bodies[0]
        self.motion = motion
        self.work = work
