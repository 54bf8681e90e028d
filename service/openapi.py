"""The OpenAPI document; `python -m service.openapi openapi/openapi.json` writes it, the same bytes every time."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from tempfile import TemporaryDirectory

from service.app import create_app
from spherify.settings import Settings


def main() -> None:
    """Write the document to the named file."""
    parser = argparse.ArgumentParser(description="Write the OpenAPI document.")
    parser.add_argument("path", type=Path)
    path: Path = parser.parse_args().path
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text(), encoding="utf-8")


def text() -> str:
    """Return the document as it is committed; it depends on the code only."""
    with TemporaryDirectory() as folder:
        app = create_app(Settings(data_dir=Path(folder)))
        return json.dumps(app.openapi(), indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    main()
