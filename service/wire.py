"""HTTP/1.1 as it comes over a connection: h11, and what it leaves to its user."""

from __future__ import annotations

import re
from typing import Any, Final

import h11

from service.problems import ProblemError

MALFORMED: Final = "this is not HTTP/1.1 as RFC 9112 has it"
MOST_TARGET: Final = 8 * 1024  # bytes of an address with its query; RFC 9112, 3, asks for 8,000 at least
MOST_HEAD: Final = 64 * 1024  # bytes before a body: all ports of localhost share their cookies
_ABSOLUTE: Final = re.compile(rb"https?://([^/?]+)(.*)", re.IGNORECASE)
TOO_LARGE: Final = ProblemError("headers-too-large", f"the headers have more than {MOST_HEAD} bytes")


class Wire(h11.Connection):
    """The server's end of one connection.

    Attributes:
        refusal: what the last request is answered with that was no good.
        refused: the path it was for, as it came; empty where it has none.

    """

    def __init__(self) -> None:
        super().__init__(h11.SERVER, MOST_HEAD)
        self.refusal = ProblemError("malformed-request", MALFORMED)
        self.refused = b""

    def next_event(self) -> Any:  # noqa: ANN401 (h11's events have no common type that uvicorn knows)
        """Return what comes next.

        Raises:
            h11.RemoteProtocolError: it is no good; `refusal` says why.

        """
        at_head = self.their_state is h11.IDLE
        try:
            event = super().next_event()
        except h11.RemoteProtocolError as e:
            if at_head and e.error_status_hint == TOO_LARGE.type.status:  # there is no end of it yet
                self._refuse_size(_target(self.trailing_data[0]))
            else:
                self.refusal = ProblemError("malformed-request", f"{MALFORMED}: {str(e)[:200]}")
            raise
        return self._checked(event) if isinstance(event, h11.Request) else event

    def _checked(self, request: h11.Request) -> h11.Request:
        size = len(request.target) + sum(len(name) + len(value) + 4 for name, value in request.headers)
        names = {name for name, _ in request.headers}
        if len(request.target) > MOST_TARGET or size > MOST_HEAD:
            self._refuse_size(request.target)
        elif {b"content-length", b"transfer-encoding"} <= names:
            # A proxy that goes by the one, and a server that goes by the other, see different requests from here on
            # (RFC 9112, 6.1 and 11.2).
            detail = f"{MALFORMED}: a request has Content-Length or Transfer-Encoding, not both"
            self.refusal = ProblemError("malformed-request", detail)
        else:
            return _in_origin_form(request)
        raise h11.RemoteProtocolError(self.refusal.detail)

    def _refuse_size(self, target: bytes) -> None:
        self.refused = target.partition(b"?")[0]
        if len(target) > MOST_TARGET:
            self.refusal = ProblemError(
                "address-too-long", f"the address has more than {MOST_TARGET} bytes, its query included"
            )
        else:
            self.refusal = TOO_LARGE


def _in_origin_form(request: h11.Request) -> h11.Request:
    """Return a request as if it had been sent to us, and not by way of a proxy (RFC 9112, 3.2.2)."""
    absolute = _ABSOLUTE.fullmatch(request.target)
    if absolute is None:
        return request
    headers = [(name, value) for name, value in request.headers if name != b"host"]
    return h11.Request(
        method=request.method,
        target=absolute[2] if absolute[2].startswith(b"/") else b"/" + absolute[2],
        headers=[(b"host", absolute[1]), *headers],  # whatever `Host` says
        http_version=request.http_version,
    )


def _target(head: bytes) -> bytes:
    """Return what the beginning of a request is for, as far as it has come."""
    _, _, rest = head.partition(b"\r\n")[0].partition(b" ")
    return rest.partition(b" ")[0]
