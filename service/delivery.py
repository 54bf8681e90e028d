"""Answers with a content: entity tags, 304, ranges, HEAD and file names (RFC 9110)."""

from __future__ import annotations

import hashlib
import re
from collections.abc import AsyncIterator, Callable, Generator, Iterator
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, BinaryIO, Final
from urllib.parse import quote

from anyio import CapacityLimiter, to_thread
from pydantic import BaseModel
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.types import Receive, Scope, Send

from service.conditions import heed, matches
from service.problems import ProblemError
from spherify.formats.names import safe_name

IMMUTABLE: Final = "private, max-age=31536000, immutable"
REVALIDATE: Final = "private, no-cache"
PIECE: Final = 256 * 1024
_MAX_STEM: Final = (80, 160)  # characters, bytes in UTF-8: file systems take 255 bytes, and the tail must fit
_RANGE: Final = re.compile(r"bytes=(\d{0,18})-(\d{0,18})")


@dataclass(frozen=True, slots=True)
class Content:
    """Something to download.

    Attributes:
        size: bytes.
        etag: strong, with its quotes: equal for equal bytes, on every replica.
        open: opens it for reading, seekable; called only when bytes are to be sent.
        filename: None where it is no file that anybody would save.
        encoding: the coding these bytes are in, such as gzip.
        verify: raises where the SHA-256 it is given is not that of the content. It is asked before the last bytes of
            the whole are sent: what a disk has damaged is broken off, and does not pass for what was written.

    """

    size: int
    etag: str
    media_type: str
    filename: str | None
    cache_control: str
    open: Callable[[], BinaryIO]
    encoding: str | None = None
    verify: Callable[[bytes], None] | None = None


def strong_etag(*parts: object) -> str:
    """Return a strong entity tag made of whatever determines the bytes."""
    return f'"{hashlib.sha256(repr(parts).encode()).hexdigest()[:32]}"'


def accepts_gzip(request: Request) -> bool:
    """Whether `Accept-Encoding` lets the answer be compressed (RFC 9110, 12.5.3)."""
    quality: dict[str, float] = {}
    for part in request.headers.get("accept-encoding", "").lower().split(","):
        coding, _, weight = part.partition(";")
        given = re.fullmatch(r"\s*q\s*=\s*([01](?:\.\d{0,3})?)\s*", weight)
        quality[coding.strip()] = float(given[1]) if given else 1.0
    return quality.get("gzip", quality.get("*", 0.0)) > 0


def not_modified(etag: str, cache_control: str, vary: str | None = None) -> Response:
    """Return 304."""
    headers = {"ETag": etag, "Cache-Control": cache_control} | ({"Vary": vary} if vary else {})
    return Response(status_code=HTTPStatus.NOT_MODIFIED, headers=headers)


def json_answer(
    request: Request,
    answer: BaseModel | Callable[[], bytes],
    *,
    status: HTTPStatus = HTTPStatus.OK,
    etag: str | None = None,
    cache_control: str = REVALIDATE,
    headers: dict[str, str] | None = None,
) -> Response:
    """Return a model, or what makes its text, as JSON; 304 when it is a GET and the client has it.

    With an ``etag`` nothing is made for a client that has it. Raises `precondition-failed` for a GET of something else.
    """
    data = None if etag else json_text(answer)
    tag = etag or text_etag(data or b"")
    common = {"ETag": tag, "Cache-Control": cache_control, **(headers or {})}
    if request.method == "GET":
        heed(request, tag)
        if matches(request, tag):
            return Response(status_code=HTTPStatus.NOT_MODIFIED, headers=common)
    return Response(data or json_text(answer), status, common, "application/json")


def text_etag(text: bytes) -> str:
    """Return the entity tag of JSON."""
    return f'"{hashlib.sha256(text).hexdigest()[:24]}"'


def json_text(answer: BaseModel | Callable[[], bytes]) -> bytes:
    """Return a model's JSON."""
    return answer.model_dump_json(by_alias=True).encode() if isinstance(answer, BaseModel) else answer()


def deliver(request: Request, content: Content, vary: str | None = None) -> Response:
    """Return a content, a range of it, or 304; raises `precondition-failed`, `range-not-satisfiable`."""
    heed(request, content.etag)
    if matches(request, content.etag):
        return not_modified(content.etag, content.cache_control, vary)
    start, end = (0, content.size) if request.scope.get("head") else _range(request, content)
    headers = {
        "ETag": content.etag,
        "Cache-Control": content.cache_control,
        "Accept-Ranges": "bytes",
        "Content-Length": str(end - start),
    }
    if content.filename is not None:
        headers["Content-Disposition"] = disposition(content.filename)
    if content.encoding is not None:
        headers["Content-Encoding"] = content.encoding
    if vary:
        headers["Vary"] = vary
    status = HTTPStatus.OK
    if end - start < content.size:
        status = HTTPStatus.PARTIAL_CONTENT
        headers["Content-Range"] = f"bytes {start}-{end - 1}/{content.size}"
    media_type = content.media_type
    if request.scope.get("head"):  # no body is sent: do not open what may be large
        return Response(status_code=status, headers=headers, media_type=media_type)
    file = content.open()
    verify = content.verify if end - start == content.size else None
    return _ClosingAnswer(
        _pieces(file, start, end, verify),
        file.close,
        status_code=status,
        headers=headers,
        media_type=media_type,
    )


async def stream(
    request: Request,
    parts: Generator[Iterator[bytes], None, None],
    limiter: CapacityLimiter,
    media_type: str,
    filename: str,
) -> Response:
    """Return what is made while it is sent, one part after the other; what ends early ends the connection.

    The first part is made before anything is said, for what goes wrong with it to be told. Only making counts for the
    limiter: it does not wait for slow clients.
    """

    async def made() -> AsyncIterator[bytes]:
        part = first
        while part is not None:
            while (piece := await to_thread.run_sync(next, part, None)) is not None:
                yield piece
            part = await to_thread.run_sync(next, parts, None, limiter=limiter)

    head = request.scope.get("head")
    first = None if head else await to_thread.run_sync(next, parts, None, limiter=limiter)
    headers = {"Cache-Control": REVALIDATE, "Content-Disposition": disposition(filename)}
    return _ClosingAnswer(made(), parts.close, headers=headers, media_type=media_type)


def file_name(stem: str, tail: str) -> str:
    """Return a safe name for a download: what it is of, cut where it is long, and `tail` whole."""
    characters, octets = _MAX_STEM
    cut = safe_name(stem)[:characters].encode()[:octets].decode(errors="ignore")
    return cut + tail


def disposition(filename: str) -> str:
    """Return a Content-Disposition that old and new clients read, whatever is in the name (RFC 6266)."""
    name = safe_name(filename)
    ascii_name = name.encode("ascii", "replace").decode().replace("?", "_")
    extended = f"; filename*=UTF-8''{quote(name, safe='')}" if ascii_name != name else ""
    return f'attachment; filename="{ascii_name}"{extended}'


def _range(request: Request, content: Content) -> tuple[int, int]:
    """Return the first byte and the one after the last; several ranges, and what is no range, mean all."""
    whole = (0, content.size)
    asked = _RANGE.fullmatch(request.headers.get("range", "").strip())
    if_range = request.headers.get("if-range")
    if asked is None or asked[0] == "bytes=-" or (if_range is not None and if_range.strip() != content.etag):
        return whole
    first, last = asked[1], asked[2]
    if first and last and int(last) < int(first):
        return whole
    start = int(first) if first else max(content.size - int(last), 0)
    end = min(int(last) + 1, content.size) if first and last else content.size
    if start >= content.size or (not first and int(last) == 0):
        raise ProblemError(
            "range-not-satisfiable",
            f"the content has {content.size} bytes",
            headers={"Content-Range": f"bytes */{content.size}"},
        )
    return start, end


class _ClosingAnswer(StreamingResponse):
    """A content whose source is closed whatever becomes of the client."""

    def __init__(
        self,
        content: Iterator[bytes] | AsyncIterator[bytes],
        close: Callable[[], None],
        **options: Any,  # noqa: ANN401 (starlette's)
    ) -> None:
        super().__init__(content, **options)
        self._close = close

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it."""
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._close()


def _pieces(file: BinaryIO, start: int, end: int, verify: Callable[[bytes], None] | None) -> Iterator[bytes]:
    file.seek(start)
    left = end - start
    digest = hashlib.sha256()
    while left > 0 and (piece := file.read(min(PIECE, left))):
        left -= len(piece)
        if verify is not None:
            digest.update(piece)
            if left == 0:
                verify(digest.digest())
        yield piece
