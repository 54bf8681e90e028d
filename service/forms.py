"""multipart/form-data, parsed while it streams in: one file to a scratch file, the fields to short strings.

FastAPI's own `UploadFile` spools any amount to disk before a route is asked; this counts, times and refuses.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header
from starlette.requests import Request

from service.problems import ProblemError, invalid
from service.uploads import KIB, Scratch, Upload, body, scratch

if TYPE_CHECKING:
    from spherify.jobs.ports import BlobStore
    from spherify.settings import Settings

FORM: Final = "multipart/form-data"
FILE_FIELD: Final = "file"
MAX_FIELDS: Final = 200
MAX_FIELD_BYTES: Final = 64 * KIB


@dataclass(frozen=True, slots=True)
class Form:
    """A form: every field with its values in their order, and the file if there was one."""

    fields: dict[str, list[str]]
    file: Upload | None


@dataclass(slots=True)
class _Part:
    name: str
    value: bytearray = field(default_factory=bytearray)


class _Reader:
    """Gathers what the parser finds; the file's bytes go straight to the scratch file."""

    def __init__(self, boundary: bytes, file: Scratch) -> None:
        self.fields: dict[str, list[str]] = {}
        self.filename: str | None = None
        self.complete = False
        self._file = file
        self._part: _Part | None = None
        self._header = (bytearray(), bytearray())
        self._headers: dict[str, str] = {}
        self._parser = MultipartParser(
            boundary,
            {
                "on_part_begin": self._begin,
                "on_header_field": lambda data, start, end: self._header[0].extend(data[start:end]),
                "on_header_value": lambda data, start, end: self._header[1].extend(data[start:end]),
                "on_header_end": self._header_end,
                "on_headers_finished": self._headers_finished,
                "on_part_data": self._data,
                "on_part_end": self._end,
                "on_end": self._complete,
            },
        )

    def write(self, piece: bytes) -> None:
        try:
            self._parser.write(piece)
        except FormParserError as e:
            raise _malformed(str(e)) from e

    def finish(self) -> None:
        if not self.complete:
            raise _malformed("the form ends before its last boundary")

    def _begin(self) -> None:
        self._headers = {}
        self._part = None

    def _header_end(self) -> None:
        name, value = (bytes(part) for part in self._header)
        self._headers[name.decode("latin-1").lower()] = value.decode("latin-1")
        for part in self._header:
            part.clear()

    def _headers_finished(self) -> None:
        kind, options = parse_options_header(self._headers.get("content-disposition"))
        if kind != b"form-data" or b"name" not in options:
            raise _malformed("a part has no `Content-Disposition: form-data; name=…`")
        name = _text(options[b"name"])
        filename = options.get(b"filename")
        if name == FILE_FIELD:
            if self.filename is not None:
                raise invalid("form/file", "repeated", "one file at a time")
            self.filename = _file_name(filename) if filename is not None else ""
        elif filename is not None:
            raise invalid(
                f"form/{name[:80]}", "unexpected-file", f"the file goes in the field `{FILE_FIELD}`"
            )
        elif sum(map(len, self.fields.values())) >= MAX_FIELDS:
            raise _malformed(f"more than {MAX_FIELDS} fields")
        self._part = _Part(name)

    def _data(self, data: bytes, start: int, end: int) -> None:
        assert self._part is not None  # the parser calls in this order  # noqa: S101
        if self._part.name == FILE_FIELD:
            self._file.feed(memoryview(data)[start:end])
            return
        self._part.value += data[start:end]
        if len(self._part.value) > MAX_FIELD_BYTES:
            raise invalid(f"form/{self._part.name[:80]}", "too-long", f"at most {MAX_FIELD_BYTES} bytes")

    def _end(self) -> None:
        if self._part is not None and self._part.name != FILE_FIELD:
            try:
                value = self._part.value.decode()
            except UnicodeDecodeError as e:
                raise invalid(f"form/{self._part.name[:80]}", "encoding", "not UTF-8") from e
            self.fields.setdefault(self._part.name, []).append(value)

    def _complete(self) -> None:
        self.complete = True


def media_type(request: Request) -> str:
    """Return the body's media type without its parameters, "" if none is named."""
    return request.headers.get("content-type", "").split(";")[0].strip().lower()


@asynccontextmanager
async def multipart(request: Request, blobs: BlobStore, settings: Settings) -> AsyncIterator[Form]:
    """Receive a form.

    Raises:
        ProblemError: unsupported-media-type, malformed-multipart, invalid-parameters, and what
            `service.uploads` raises.

    """
    if media_type(request) != FORM:
        raise ProblemError("unsupported-media-type", f"send {FORM}, not {media_type(request)!r}")
    _, options = parse_options_header(request.headers.get("content-type"))
    boundary = options.get(b"boundary", b"")
    if not boundary:
        raise _malformed("the Content-Type names no boundary")
    async with scratch(request, blobs, settings) as file:
        try:
            reader = _Reader(boundary, file)
        except FormParserError as e:
            raise _malformed(str(e)) from e
        async for piece in body(request, settings.max_upload_bytes, settings.upload_timeout_s):
            reader.write(piece)
            await file.flush_if_full()
        reader.finish()
        upload = await file.finish(reader.filename) if reader.filename is not None else None
        yield Form(reader.fields, upload)


def _text(value: bytes) -> str:
    return value.decode("utf-8", "replace")


def _file_name(value: bytes) -> str:
    """Return a name as it was before browsers and curl wrote it into a form (WHATWG HTML, 4.10.22.8)."""
    return _text(value).replace("%22", '"').replace("%0D", "\r").replace("%0A", "\n")


def _malformed(detail: str) -> ProblemError:
    return ProblemError("malformed-multipart", detail)
