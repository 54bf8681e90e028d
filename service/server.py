"""The HTTP server: uvicorn, with a limit on everything a client may do slowly, or not at all.

What uvicorn lacks, and a public port needs: a deadline for the headers of a request, one for a client that does not
read its answer, a limit on connections that leaves room for the probes, and an answer to broken HTTP that is a
problem document as all others are. How slowly a body may come is the business of `service.uploads`.
"""

from __future__ import annotations

import asyncio
import json
import resource
import socket
import struct
from collections.abc import Callable
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import unquote_to_bytes

import h11
import uvicorn
from starlette.types import Receive, Scope, Send
from ulid import ULID
from uvicorn.protocols.http.h11_impl import H11Protocol

from service.answers import LINGER_S, instance
from service.middleware import REQUEST_ID
from service.problems import MEDIA_TYPE, ProblemError
from service.wire import Wire

HEADERS_S: Final = 10.0  # from the first byte of a request, or from the connection, to the end of its headers
ANSWER_S: Final = 60.0  # a client that takes nothing of its answer for this long does not want it
IDLE_S: Final = 75.0  # between two requests: longer than a client that polls is told to wait
DESCRIPTORS: Final = 256  # kept back from connections: files, the store, programs that read meshes
PROBES: Final = frozenset({"/healthz", "/readyz"})
_CROWDED: Final = "there are {} connections already, and no more are taken"


class Protocol(H11Protocol):
    """One connection."""

    headers_s = HEADERS_S
    answer_s = ANSWER_S
    most_connections = 0
    conn: Wire

    def __init__(self, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401 (uvicorn's)
        super().__init__(*args, **kwargs)
        self.conn = Wire()
        self._headers_due: asyncio.TimerHandle | None = None
        self._answer_due: asyncio.TimerHandle | None = None
        self._lingering: asyncio.TimerHandle | None = None
        self._app = self.app

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override] # as in uvicorn
        """Begin: the headers of the first request are due."""
        super().connection_made(transport)
        self._await_headers()

    def data_received(self, data: bytes) -> None:
        """Take bytes in, and see whether they are within a request or begin one."""
        if self._lingering is not None:
            return
        self.app = self._app if len(self.connections) <= self.most_connections else self._crowded
        super().data_received(data)
        if self.conn.their_state is not h11.IDLE:
            self._cancel("_headers_due")
        elif self._headers_due is None and not self._answering():
            self._await_headers()

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self._cancel("_headers_due")
        self._cancel("_answer_due")
        self._cancel("_lingering")
        super().connection_lost(exc)

    def shutdown(self) -> None:
        """End as soon as what is being answered is."""
        if self._lingering is None:
            super().shutdown()
        else:
            self.transport.close()

    def pause_writing(self) -> None:
        """Wait until the client has read, for a while."""
        super().pause_writing()
        self._cancel("_answer_due")
        self._answer_due = self.loop.call_later(self.answer_s, self._cut)

    def resume_writing(self) -> None:
        """Go on."""
        self._cancel("_answer_due")
        super().resume_writing()

    def send_400_response(self, _: str) -> None:
        """Answer what is no HTTP."""
        self._refuse(self.conn.refusal, self.conn.refused)

    def _answering(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _await_headers(self) -> None:
        self._headers_due = self.loop.call_later(self.headers_s, self._headers_missing)

    def _headers_missing(self) -> None:
        self._headers_due = None
        if self.transport.is_closing():
            return
        if self.conn.trailing_data[0]:
            detail = f"the headers of a request were not complete after {self.headers_s:g} s"
            self._refuse(ProblemError("request-timeout", detail))
        else:
            self.transport.close()  # it never asked anything

    def _refuse(self, problem: ProblemError, path: bytes = b"") -> None:
        """Answer without the application, and close; nothing is put into the middle of another answer."""
        if self._answering() and self.cycle.response_started:
            self.transport.abort()
            return
        request_id = f"req_{ULID()}"
        place = instance(unquote_to_bytes(path).decode(errors="replace"))
        document = json.dumps(problem.document(place, request_id))
        status = HTTPStatus(problem.type.status)
        head = [
            f"HTTP/1.1 {status.value} {status.phrase}",
            f"content-type: {MEDIA_TYPE}",
            f"content-length: {len(document)}",
            "cache-control: no-store",
            f"{REQUEST_ID}: {request_id}",
            "connection: close",
        ]
        self.transport.write("\r\n".join([*head, "", document]).encode())
        self._linger()

    def _linger(self) -> None:
        """Say nothing more, and hear the client out for a moment: see `service.answers.LastAnswer`."""
        self._cancel("_headers_due")
        if self.cycle is not None:  # whoever works at its request has nobody to answer
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self._lingering = self.loop.call_later(LINGER_S, self.transport.close)
        self.flow.resume_reading()
        self.transport.write_eof()

    async def _crowded(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let the probes in, and refuse all others, in the application's own words."""
        if scope["path"] not in PROBES:
            scope["state"]["refusal"] = ProblemError(
                "not-ready",
                _CROWDED.format(self.most_connections),
                headers={"Connection": "close"},
            )
        await self._app(scope, receive, send)

    def _cut(self) -> None:
        """Reset: closed in good order, the kernel would go on offering what nobody reads."""
        connection = self.transport.get_extra_info("socket")
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.transport.abort()

    def _cancel(self, name: str) -> None:
        timer = getattr(self, name)
        if timer is not None:
            timer.cancel()
            setattr(self, name, None)


def protocol(
    *, headers_s: float = HEADERS_S, answer_s: float = ANSWER_S, most_connections: int | None = None
) -> type[Protocol]:
    """Return the connection class with these limits; connections are limited by the descriptors by default."""
    limits = {
        "headers_s": headers_s,
        "answer_s": answer_s,
        "most_connections": most_connections or _room_for_connections(),
    }
    return type("Protocol", (Protocol,), limits)


def configuration(app: str | Callable[..., Any], **options: Any) -> uvicorn.Config:  # noqa: ANN401 (uvicorn's)
    """Return how the application, or the name of its factory, is served."""
    defaults: dict[str, Any] = {
        "factory": isinstance(app, str),
        "http": protocol(),
        "ws": "none",
        "server_header": False,
        "access_log": False,  # ours says more; this one would be made for every answer, and thrown away
        "backlog": 4096,
        "timeout_keep_alive": IDLE_S,
        "timeout_graceful_shutdown": 5,
        "use_colors": False,
    }
    return uvicorn.Config(app, **defaults | options)


def _room_for_connections() -> int:
    """Take as many descriptors as we are allowed to, and return how many are for connections."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard not in {soft, resource.RLIM_INFINITY}:
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
        soft = hard
    return max(soft - DESCRIPTORS, soft // 2)
