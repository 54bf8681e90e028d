"""HTTP/1.1 as it comes over a connection: h11, and what it leaves to its user."""

from __future__ import annotations

from typing import Any, Final

import h11

from service.problems import ProblemError

MALFORMED: Final = "this is not HTTP/1.1 as RFC 9112 has it"


class Wire(h11.Connection):
    """The server's end of one connection.

    Attributes:
        refusal: what the last request is answered with that was no good.

    """

    def __init__(self) -> None:
        super().__init__(h11.SERVER)
        self.refusal = ProblemError("malformed-request", MALFORMED)

    def next_event(self) -> Any:  # noqa: ANN401 (h11's events have no common type that uvicorn knows)
        """Return what comes next.

        Raises:
            h11.RemoteProtocolError: it is no good; `refusal` says why.

        """
        try:
            event = super().next_event()
            return _checked(event) if isinstance(event, h11.Request) else event
        except h11.RemoteProtocolError as e:
            self.refusal = ProblemError("malformed-request", f"{MALFORMED}: {str(e)[:200]}")
            raise


def _checked(request: h11.Request) -> h11.Request:
    """Return a request as the application expects it."""
    names = {name for name, _ in request.headers}
    if {b"content-length", b"transfer-encoding"} <= names:
        # A proxy that goes by the one, and a server that goes by the other, see different requests from here on
        # (RFC 9112, 6.1 and 11.2).
        raise h11.RemoteProtocolError("a request has Content-Length or Transfer-Encoding, not both")
    return request
