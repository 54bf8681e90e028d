"""What is built to be installed elsewhere carries the built page, and nothing of what it was built with."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from tests.architecture.source import ROOT

PARTS = ("spherify", "service", "worker")
FILES = ("pyproject.toml", "README.md", "LICENSE")
PAGE = ROOT / "service" / "web" / "dist"
BUILD = "from setuptools import build_meta as b; b.build_wheel('dist'); b.build_sdist('dist')"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """The files in the wheel and in the sdist, built from a copy: a build leaves things where it is done."""
    assert (PAGE / "index.html").exists(), "the web page is not built: `make setup`"
    copy = tmp_path_factory.mktemp("packages")
    for part in PARTS:
        shutil.copytree(
            ROOT / part, copy / part, ignore=shutil.ignore_patterns("node_modules", "__pycache__", "data")
        )
    for file in FILES:
        shutil.copy(ROOT / file, copy)
    subprocess.run([sys.executable, "-c", BUILD], cwd=copy, check=True, capture_output=True)
    (wheel,) = (copy / "dist").glob("*.whl")
    (sdist,) = (copy / "dist").glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as zipped, tarfile.open(sdist) as tarred:
        inner = {str(Path(*Path(name).parts[1:])) for name in tarred.getnames()}
        return {"wheel": set(zipped.namelist()), "sdist": inner}


@pytest.mark.parametrize("kind", ["wheel", "sdist"])
def test_a_package_carries_the_built_page(built: dict[str, set[str]], kind: str) -> None:
    page = {path.relative_to(ROOT).as_posix() for path in PAGE.rglob("*") if path.is_file()}
    assert any(name.startswith("service/web/dist/assets/viewer-") for name in page)
    assert page <= built[kind]
    assert not {name for name in built[kind] if "node_modules" in name}


def test_a_wheel_carries_the_scripts_of_the_store(built: dict[str, set[str]]) -> None:
    scripts = {path.relative_to(ROOT).as_posix() for path in (ROOT / "spherify").rglob("*.lua")}
    assert scripts
    assert scripts <= built["wheel"]
