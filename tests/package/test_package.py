"""The package as others get it: what a wheel holds, one version, and which Python is taken."""

import re
import shutil
import subprocess
import sys
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

import ngcontact

ROOT = Path(__file__).parents[2]
LINK = Path("ngcontact", "geometries")
BUILD = "import sys; from setuptools.build_meta import build_wheel; build_wheel(sys.argv[1])"


def shipped():
    """Names of the files that a wheel should bring."""
    rooms = {path.relative_to(ROOT) for path in (ROOT / "ngcontact").rglob("*.py*")}
    geometries = {LINK / path.name for path in (ROOT / "geometries").glob("*.py*")}
    sources = {path.as_posix() for path in rooms | geometries if path.suffix in (".py", ".pyi")}
    return sources | {"ngcontact/py.typed"}


@pytest.fixture(params=["with the link", "without the link"])
def wheel(request, tmp_path):
    """Wheel of the repository; links are not for every system."""
    source = tmp_path / "source"
    left = shutil.ignore_patterns(".*", "docs", "out", "build", "dist", "*.egg-info", "__pycache__")
    shutil.copytree(ROOT, source, symlinks=True, ignore=left)
    if request.param == "without the link" and (source / LINK).is_symlink():
        (source / LINK).unlink()
    subprocess.run(
        [sys.executable, "-c", BUILD, tmp_path], cwd=source, capture_output=True, check=True
    )
    [path] = tmp_path.glob("*.whl")
    with zipfile.ZipFile(path) as archive:
        yield archive


def test_a_wheel_brings_one_package_and_its_types(wheel):
    [information] = [name for name in wheel.namelist() if name.endswith(".dist-info/METADATA")]
    brought = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert {name.split("/")[0] for name in brought} == {"ngcontact"}
    assert brought == shipped()
    assert "ngcontact/geometries/straight.py" in brought
    metadata = Parser().parsestr(wheel.read(information).decode())
    assert metadata["Version"] == ngcontact.__version__
    assert {"notebook", "files", "parallel", "test", "dev", "docs", "bench"} == set(
        metadata.get_all("Provides-Extra")
    )


def test_one_version_everywhere():
    [cited] = re.findall(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    newest = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert (cited, newest[1]) == (ngcontact.__version__, ngcontact.__version__)
