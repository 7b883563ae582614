"""Stress: an adaptive run is interrupted; what it had given stays whole, in memory and on disk."""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyvista
from numpy.typing import NDArray

from drivers.reference.cases import hertz_contact
from drivers.stress import Outcome
from ngcontact import Problem, Solution, adapt, write_series

ORDER, MAXH, MAX_DOFS = 2, 0.5, 3000
SHARES = np.linspace(0.05, 0.95, 12)  # of the time a run takes: moments of the timer
WAITS = (0.0, 0.05, 0.15, 0.4)  # seconds after the first level is on disk

# What a user's script may look like; the run is far too long to finish.
SCRIPT = """
import sys
from drivers.reference.cases import hertz_contact
from ngcontact import adapt, write_series
write_series(sys.argv[1], adapt(hertz_contact().problem, order=2, maxh=0.5, max_dofs=10**7))
"""


def _problem(gap: Callable[[Any, Any], Any]) -> Problem:
    problem = hertz_contact().problem
    return replace(problem, contact=[replace(problem.contact[0], gap=gap)])


def _parabola(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    return x**2 / 10


class _Interrupting:
    """The gap of Hertz contact; its call number `at` sends what Ctrl-C sends."""

    def __init__(self, at: int) -> None:
        self.at, self.calls = at, 0

    def __call__(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        self.calls += 1
        if self.calls == self.at:
            signal.raise_signal(signal.SIGINT)
        return _parabola(x, y)


class _Failing:
    """A solution of which one attribute raises KeyboardInterrupt."""

    def __init__(self, solution: Solution, name: str) -> None:
        self._solution, self._name = solution, name

    def __getattr__(self, name: str) -> Any:
        if name == self._name:
            raise KeyboardInterrupt
        return getattr(self._solution, name)


def _run(problem: Problem) -> Iterator[Solution]:
    return adapt(problem, order=ORDER, maxh=MAXH, max_dofs=MAX_DOFS)


def _until_interrupted(problem: Problem) -> tuple[list[Solution], bool]:
    """The solutions a run yields, and whether it was interrupted."""
    given: list[Solution] = []
    try:
        for solution in _run(problem):
            given.append(solution)
    except KeyboardInterrupt:
        return given, True
    return given, False


def _whole(folder: Path) -> bool:
    """Whether every file is one of a run's, can be read, and the series lists none that misses."""
    for path in folder.iterdir():
        if path.suffix == ".pvd":
            listed = [entry.get("file", "") for entry in ET.parse(path).iter("DataSet")]
            if not all((folder / name).is_file() for name in listed):
                return False
        elif path.name.startswith(".") or path.suffix not in (".vtu", ".vtp"):
            return False
        elif pyvista.read(path).n_points == 0:
            return False
    return True


def _outcome(varied: str, given: list[Solution], right: list[Solution]) -> Outcome:
    """Whether the solutions given before an interruption answer as those of a whole run do."""
    error = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for solution, whole in zip(given, right, strict=False):
            for name in ("pressure", "gap", "force", "indicators"):
                value, reference = getattr(solution, name), getattr(whole, name)
                off = np.abs(value - reference).max() / np.abs(reference).max()
                error = max(error, float(off))
        if given:
            write_series(Path(folder) / "run.pvd", given)
            error = error if _whole(Path(folder)) else float("inf")
    return Outcome(
        case="Hertz, adaptive",
        varied=f"{varied}, {len(given)} levels given",
        steps=sum(len(solution.steps) for solution in given),
        residual=max((max(s.residuals.values()) for s in given), default=0.0),
        error=error,
        allowed=1e-12,  # the same steps of the same program; threads of NGSolve may sum otherwise
    )


def in_memory() -> Iterator[Outcome]:
    """Interrupted by a gap function and by a timer: earlier solutions still answer."""
    started = time.perf_counter()
    right, _ = _until_interrupted(_problem(_parabola))
    duration = time.perf_counter() - started
    counting = _Interrupting(0)
    _until_interrupted(_problem(counting))
    for at in np.unique(np.linspace(1, counting.calls, 6).astype(int)):
        given, interrupted = _until_interrupted(_problem(_Interrupting(int(at))))
        outcome = _outcome(f"call {at} of the gap", given, right)
        yield outcome if interrupted else replace(outcome, error=float("inf"))
    if hasattr(signal, "setitimer"):
        for share in SHARES:
            given = _with_timer(share * duration)
            yield _outcome(f"after {share:.0%} of the time", given, right)


def _with_timer(seconds: float) -> list[Solution]:
    """The solutions of a run that a timer interrupts.

    NGSolve's `CF` of a tuple loses an exception raised by a signal, or makes it a RuntimeError:
    then the run goes on, or ends with that.
    """
    fired = False

    def interrupt(number: int, frame: object) -> None:
        nonlocal fired
        fired = True
        raise KeyboardInterrupt

    given: list[Solution] = []
    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        for solution in _run(_problem(_parabola)):
            given.append(solution)
    except (KeyboardInterrupt, RuntimeError):
        if not fired:
            raise
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    return given


def _files(case: str, varied: str, whole: bool) -> Outcome:
    return Outcome(case, varied, 0, 0.0, 0.0 if whole else float("inf"), 0.0)


def while_writing() -> Iterator[Outcome]:
    """Interrupted between and within the two files of a solution: the old ones stay as they are."""
    first, second, *_ = _until_interrupted(_problem(_parabola))[0]
    for name in ("displacement", "points", "gap", "pair"):
        with tempfile.TemporaryDirectory() as folder:
            target = Path(folder) / "hertz.vtu"
            first.write(target)
            before = {path.name: path.read_bytes() for path in Path(folder).iterdir()}
            raised, failing = False, cast(Solution, _Failing(second, name))
            try:
                Solution.write(failing, target)
            except KeyboardInterrupt:
                raised = True
            after = {path.name: path.read_bytes() for path in Path(folder).iterdir()}
            whole = raised and before == after and len(after) == 2
        yield _files("writing over files", f"interrupted at {name}", whole)


def _interrupt(process: subprocess.Popen[bytes]) -> None:
    """Ctrl-C, again where NGSolve lost it (see `_with_timer`)."""
    for _ in range(5):
        process.send_signal(signal.SIGINT)
        try:
            process.wait(timeout=3)
        except subprocess.TimeoutExpired:
            continue
        return
    process.kill()


def in_another_process() -> Iterator[Outcome]:
    """Ctrl-C in a script that writes a series: whole files and the levels that are listed."""
    root = Path(__file__).parents[3]
    for wait in WAITS:
        with tempfile.TemporaryDirectory() as folder:
            series = Path(folder) / "run.pvd"
            command = [sys.executable, "-c", SCRIPT, str(series)]
            with subprocess.Popen(command, cwd=root, stderr=subprocess.DEVNULL) as process:
                while not series.exists() and process.poll() is None:
                    time.sleep(0.005)
                time.sleep(wait)
                _interrupt(process)
            ended = process.returncode not in (0, -signal.SIGKILL)
            whole = ended and series.exists() and _whole(Path(folder))
        yield _files("series in a script", f"Ctrl-C {wait} s after the first level", whole)


def outcomes() -> Iterator[Outcome]:
    """In memory, while writing, and in another process where Ctrl-C can be sent to one."""
    # A process started in the background of a shell ignores Ctrl-C, and so would its children.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield from in_memory()
    yield from while_writing()
    if sys.platform != "win32":
        yield from in_another_process()
