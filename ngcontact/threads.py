"""Threads that NGSolve and Netgen start."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import ngsolve as ng

_COUNT = threading.Lock()  # of the threads of managers to come, one number for the whole process


@contextmanager
def one_thread() -> Iterator[None]:
    """NGSolve starts no threads of its own; those of a caller's ``with TaskManager():`` serve on.

    Whatever the number of threads is set to, it is the same before and after.
    """
    with ExitStack() as managers:
        if ng.GetNumThreads() == 1:  # of a manager that this Python thread has entered
            with _COUNT:
                count = ng.ngsglobals.numthreads
                ng.SetNumThreads(1)
                managers.enter_context(ng.TaskManager())
                ng.SetNumThreads(count)
        yield
