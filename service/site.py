"""The web page: the files that `make setup` builds from service/web, with the headers they go out with."""

from __future__ import annotations

import gzip
import hashlib
import mimetypes
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from starlette.requests import Request
from starlette.responses import Response

from service.conditions import heed, matches
from service.delivery import accepts_gzip, not_modified

BUILT: Final = Path(__file__).parent / "web" / "dist"
NOT_BUILT: Final = (
    "The web page is not built: `make setup` builds it, with Node 20 or newer or with the wheel of it."
)

_FOREVER: Final = "public, max-age=31536000, immutable"  # the name holds a hash of the content
_LOOK_AGAIN: Final = "no-cache"
_POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "worker-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors {}"
)
_ZIPPED: Final = frozenset({".html", ".js", ".css", ".svg"})


@dataclass(frozen=True, slots=True)
class SiteFile:
    """One file, ready to be sent: as it is, and compressed where that makes it smaller."""

    data: bytes
    zipped: bytes | None
    etag: str
    headers: dict[str, str]

    def answer(self, request: Request) -> Response:
        """Return the file, or 304; raises `precondition-failed`."""
        zipped = self.zipped if accepts_gzip(request) else None
        etag = self.etag if zipped is None else f'{self.etag[:-1]}-gzip"'
        heed(request, etag)
        if matches(request, etag):
            return not_modified(etag, self.headers["Cache-Control"], "Accept-Encoding")
        headers = self.headers | {"ETag": etag} | ({"Content-Encoding": "gzip"} if zipped else {})
        return Response(zipped or self.data, headers=headers)


class Site:
    """The built page in memory; it is two megabytes."""

    def __init__(self, folder: Path = BUILT) -> None:
        found = sorted(path for path in folder.rglob("*") if path.is_file()) if folder.is_dir() else []
        self._files = {path.relative_to(folder).as_posix(): _load(path, folder) for path in found}

    @property
    def built(self) -> bool:
        """Whether there is a page."""
        return "index.html" in self._files

    def find(self, name: str) -> SiteFile | None:
        """Return a file by its path within the page, None if there is none."""
        return self._files.get(name)


def _load(path: Path, folder: Path) -> SiteFile:
    name, data = path.relative_to(folder).as_posix(), path.read_bytes()
    kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
    kind = "text/javascript" if path.suffix == ".js" else kind  # some systems have older names for it
    headers = {
        "Content-Type": f"{kind}; charset=utf-8" if kind.startswith("text/") else kind,
        "Cache-Control": _FOREVER if name.startswith("assets/") else _LOOK_AGAIN,
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "same-origin",
        "Vary": "Accept-Encoding",
    }
    if path.suffix == ".html":
        headers["Content-Security-Policy"] = _POLICY.format("*" if name == "embed.html" else "'self'")
    if name.startswith("assets/") and path.suffix == ".js":  # workers have a policy of their own
        headers["Content-Security-Policy"] = _POLICY.format("'none'")
    if name == "spherify-viewer.js":  # for pages of other origins
        headers |= {"Access-Control-Allow-Origin": "*", "Cross-Origin-Resource-Policy": "cross-origin"}
    zipped = gzip.compress(data, 6, mtime=0) if path.suffix in _ZIPPED else None
    if zipped is not None and len(zipped) >= len(data):
        zipped = None
    return SiteFile(data, zipped, f'"{hashlib.sha256(data).hexdigest()[:32]}"', headers)
