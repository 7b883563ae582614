"""Fixtures of several rooms. Nothing here loads NGSolve: tests of arrays run without it."""

import ctypes
import gc

import pytest

ORDERS = {"constant pressure": (1, 3), "linear pressure": (2, 4), "polygonal line": (1, 2)}


@pytest.fixture(
    params=[
        pytest.param((name, order), id=f"{name}, order {order}")
        for name, orders in ORDERS.items()
        for order in orders
    ]
)
def reproduced(request):
    """A case and an order at which its solution lies in the space."""
    from tests.scenes import REPRODUCED

    name, order = request.param
    return REPRODUCED[name](), order


@pytest.fixture(autouse=True, scope="module")
def _memory():
    """What a file leaves is given back to the system: a process runs many of them."""
    yield
    gc.collect()
    if trim := getattr(ctypes.CDLL(None), "malloc_trim", None):  # of glibc
        trim(0)


@pytest.fixture
def no_work(monkeypatch):
    """Nothing can be assembled, so nothing can be solved."""
    import ngsolve as ng

    def forbidden(*args, **kwargs):
        raise AssertionError("a form was made before the arguments were checked")

    monkeypatch.setattr(ng, "BilinearForm", forbidden)
    monkeypatch.setattr(ng, "LinearForm", forbidden)


@pytest.fixture
def two_threads():
    """Managers take two threads; as many as before afterwards."""
    import ngsolve as ng

    before = ng.ngsglobals.numthreads
    ng.SetNumThreads(2)
    yield
    ng.SetNumThreads(before)


def pytest_collection_finish():
    """Modules stay: collecting what tests leave does not look at them again."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """The rows of a study that are its witness are tests: they keep no mark."""
    missing = {}
    for item in items:
        study = item.get_closest_marker("study")
        if study and (witness := study.kwargs.get("witness")):
            missing.setdefault((item.path, item.originalname), set(witness)).discard(
                item.callspec.id
            )
            if item.callspec.id in witness:
                item.own_markers[:] = [m for m in item.own_markers if m.name != "study"]
    missing = {name: rows for (_, name), rows in missing.items() if rows}
    if missing and not any("::" in argument for argument in config.args):
        raise pytest.UsageError(f"no such rows to be a witness of a study: {missing}")
