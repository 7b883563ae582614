"""Progress of adaptive runs in a terminal: lines, the share that is done, and silence."""

from types import SimpleNamespace

import pytest

from drivers.reference import cases
from ngcontact import adapt
from ngcontact.results import with_progress


def level(unknowns, error, bound=None):
    return SimpleNamespace(
        displacement=SimpleNamespace(space=SimpleNamespace(ndof=unknowns)),
        relative_error_estimate=error,
        bounded=bound is not None,
        relative_error_bound=bound,
    )


def lines(capsys):
    out, err = capsys.readouterr()
    assert out == ""
    return err.splitlines()


def test_a_run_is_quiet_unless_asked(capsys):
    options = {"order": 2, "max_dofs": 1500}
    quiet = list(adapt(cases.partly_opening_block(), **options))
    assert lines(capsys) == []
    told = list(adapt(cases.partly_opening_block(), **options, progress=True))
    head, *rows = lines(capsys)
    assert head.split() == ["level", "unknowns", "estimate", "seconds"]
    assert [int(row.split()[1]) for row in rows] == [s.displacement.space.ndof for s in quiet]
    assert len(told) == len(rows)
    estimates = [f"{s.relative_error_estimate:.2e}" for s in told]
    assert [row.split()[2] for row in rows] == estimates
    with pytest.raises(TypeError, match="progress='yes'"):
        adapt(cases.partly_opening_block(), progress="yes")


def test_the_bar_counts_digits_towards_the_tolerance(capsys):
    """From 1e-1 to 1e-3: 1e-2 is half of the way."""
    levels = [level(10, 1e-1), level(20, 1e-2), level(40, 1e-3)]
    assert list(with_progress(iter(levels), 1e-3, 100)) == levels
    assert [row.count("#") for row in lines(capsys)[1:]] == [0, 10, 20]
