"""Plugin of `make smoke`: of every file of tests the first one that is no study."""


def pytest_collection_modifyitems(config, items):
    """Deselect what follows the first test of a file."""
    quick = [item for item in items if item.get_closest_marker("study") is None]
    first = {item.path: item for item in reversed(quick)}
    rest = [item for item in items if item is not first.get(item.path)]
    config.hook.pytest_deselected(items=rest)
    items[:] = [item for item in items if item is first.get(item.path)]
