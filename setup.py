"""What a wheel holds: `ngcontact` with its rooms, and the folder `geometries` as one of them.

The link `ngcontact/geometries` is for tools that read folders (type checker, import contracts,
doctests, an uninstalled checkout); a wheel does not need it, since not every system makes links.
"""

from setuptools import find_packages, setup

rooms = find_packages(include=["ngcontact*"], exclude=["ngcontact.geometries*"])
setup(
    packages=[*rooms, "ngcontact.geometries"],
    package_dir={"ngcontact.geometries": "geometries"},
    package_data={"": ["py.typed", "*.pyi"]},
)
