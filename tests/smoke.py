"""Plugin of `make smoke`: of every file of tests the first one."""


def pytest_collection_modifyitems(config, items):
    """Deselect what follows the first test of a file."""
    first = {item.path: item for item in reversed(items)}
    rest = [item for item in items if item is not first[item.path]]
    config.hook.pytest_deselected(items=rest)
    items[:] = [item for item in items if item is first[item.path]]
