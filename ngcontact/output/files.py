"""Files that replace older ones only when they are complete."""

from __future__ import annotations

import os
import tempfile
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")


def several(solutions: Iterable[T]) -> Iterable[T]:
    """The solutions; ``TypeError`` where they are no series, as one alone is none."""
    if not isinstance(solutions, Iterable):
        raise TypeError(f"solutions is a {type(solutions).__name__}: give a list of Solution")
    return solutions


def check_path(path: str | os.PathLike[str], suffix: str) -> Path:
    """Output path, known to be writable; to be called before any work is done.

    Raises ``ValueError`` if the name does not end in `suffix` and the fitting ``OSError`` if its
    folder is missing, none or refuses new files, or if it is a folder or a protected file.
    """
    target = Path(path)
    say = f"cannot write {str(target)!r}: "
    if target.suffix.lower() != suffix:
        raise ValueError(f"{say}the name must end in {suffix!r}")
    try:
        tempfile.TemporaryFile(dir=target.parent).close()
    except OSError as error:
        reason = f"{say}no file can be made in {str(target.parent)!r} ({error.strerror})"
        raise OSError(error.errno, reason) from error
    if target.is_dir():
        raise IsADirectoryError(f"{say}it is a folder; give the name of a file")
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(f"{say}the file is write-protected; choose another name")
    return target


@contextmanager
def replacing(*paths: Path) -> Iterator[list[Path]]:
    """Temporary names beside `paths`, renamed to them on success and removed on failure."""
    mark = uuid.uuid4().hex[:8]
    drafts = [path.with_name(f".{path.stem}-{mark}{path.suffix.lower()}") for path in paths]
    try:
        yield drafts
        for draft, path in zip(drafts, paths, strict=True):
            os.replace(draft, path)
    finally:
        for draft in drafts:
            draft.unlink(missing_ok=True)
