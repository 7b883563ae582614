"""Command lines made from signatures: every driver is a function ``main`` of typed keywords.

Types, choices and defaults come from the signature, what a parameter is and its unit from the
docstring. Values are checked before anything runs.
"""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Callable, Sequence
from typing import Annotated, Any, TypeAlias, TypeVar

from cyclopts import App, CycloptsError, Group, Parameter, Token
from cyclopts.validators import Number

Result = TypeVar("Result")


def _whole(_: object, tokens: Sequence[Token]) -> int:
    """Integer, also written as 2e4; 2.5 is refused rather than rounded."""
    text = tokens[0].value
    try:
        value = float(text)
        if value == int(value):
            return int(value)
    except (ValueError, OverflowError):
        pass
    raise ValueError(f'expected a whole number, got "{text}".')


def _positive(_: object, value: float | None) -> None:
    if value is not None and not 0 < value < math.inf:  # defaults are checked as well
        raise ValueError("Must be positive and finite.")


def _default(value: object) -> str:
    """As it is written on the command line."""
    if isinstance(value, tuple):
        return " ".join(map(_default, value))
    if value is None:
        return "none"
    return f"{value:g}" if isinstance(value, float) else shlex.quote(str(value))


Positive: TypeAlias = Annotated[float, Parameter(validator=_positive)]
Count: TypeAlias = Annotated[int, Parameter(converter=_whole, validator=Number(gte=1))]
Seed: TypeAlias = Annotated[int, Parameter(converter=_whole, validator=Number(gte=0))]
Order: TypeAlias = Annotated[int, Parameter(converter=_whole, validator=Number(gte=1, lte=4))]


def module_of(main: Callable[..., object]) -> str:
    """What follows ``python -m`` to run `main`."""
    spec = sys.modules[main.__module__].__spec__  # of __main__, the module that was asked for
    return spec.name.removesuffix(".__main__") if spec else main.__module__


def run(main: Callable[..., Result], tokens: Sequence[str] | None = None) -> Result:
    """Call `main` with the parameters of a command line; return what it returns.

    Parameters
    ----------
    main : callable
        Its signature says which parameters there are, its numpydoc docstring what they mean.
    tokens : sequence of str, optional
        The command line; by default that of this process.

    Raises
    ------
    SystemExit
        With status 0 after ``--help``, which runs nothing; with status 2 after a message if a
        parameter is unknown or its value is none it can have. A ``ValueError`` of `main` is such
        a message; ``python -X dev`` shows where it comes from.
    """
    every: dict[str, Any] = {"negative": (), "consume_multiple": (1, None)}
    app = App(
        name=f"python -m {module_of(main)}",
        default_command=main,
        help_format="markdown",
        version_flags=(),
        group_commands=Group("Commands", show=False),  # there are none but --help
        default_parameter=Parameter(show_default=_default, **every),
    )
    try:
        command, arguments, _ = app.parse_args(tokens, exit_on_error=False)
    except CycloptsError as error:  # its message is on the screen
        raise SystemExit(2) from error
    if command is not main:  # but the help asked for
        command(*arguments.args, **arguments.kwargs)
        raise SystemExit(0)
    try:
        return main(*arguments.args, **arguments.kwargs)
    except ValueError as error:
        if sys.flags.dev_mode:
            raise
        print(f"{error}\n(python -X dev -m {module_of(main)} ... shows where)", file=sys.stderr)
        raise SystemExit(2) from error
