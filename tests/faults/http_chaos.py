"""An HTTP proxy before a server that refuses, loses, cuts off and never answers, request by request."""

from __future__ import annotations

import http.client
import random
import threading
from collections import Counter
from collections.abc import Callable
from enum import Enum
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from typing import Final, Self


class Fault(Enum):
    """What is done to one request."""

    REFUSE = "500, and the server never heard of it"
    LOSE = "500, although the server did it"
    RESET = "the server did it, and the connection ends without an answer"
    CUT = "the connection to the server ends in the middle of the body, and so does the client's"
    HANG = "the server did it, and nothing is answered until the client gives up"
    FULL = "507, and the server never heard of it"


Plan = Callable[[str, str], Fault | None]
"""From the method and the path of a request to its fault."""

PASSING: Final = (Fault.REFUSE, Fault.LOSE, Fault.RESET, Fault.CUT, Fault.HANG)
"""What may happen to anybody, and is over with the next try."""


class HttpChaos:
    """Passes requests on to a port of the loopback, as the plan lets it.

    Attributes:
        plan: may be changed at any time.
        requests: passed on or not.
        hits: how often each fault struck.

    """

    def __init__(self, target: int, plan: Plan = lambda _method, _path: None) -> None:
        self.plan = plan
        self.requests = 0
        self.hits: Counter[Fault] = Counter()
        lock = threading.Lock()
        outer = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def handle_one_request(self) -> None:
                try:
                    super().handle_one_request()
                except OSError:  # the client is gone
                    self.close_connection = True

            def pass_on(self) -> None:
                body = self.rfile.read(int(self.headers.get("content-length", 0)))
                with lock:
                    fault = outer.plan(self.command, self.path)
                    outer.requests += 1
                    if fault is not None:
                        outer.hits[fault] += 1
                if fault in {Fault.REFUSE, Fault.FULL}:
                    self.answer(507 if fault is Fault.FULL else 500)
                    return
                connection = http.client.HTTPConnection("127.0.0.1", target, timeout=60)
                try:
                    connection.putrequest(self.command, self.path, skip_host=True, skip_accept_encoding=True)
                    for name, value in self.headers.items():
                        connection.putheader(name, value)
                    connection.endheaders(body[: len(body) // 2] if fault is Fault.CUT else body)
                    if fault is Fault.CUT:
                        self.close_connection = True
                        return
                    found = connection.getresponse()
                    content = found.read()
                except (OSError, http.client.HTTPException):  # the server is down, and so is this connection
                    self.close_connection = True
                    return
                finally:
                    connection.close()
                if fault is Fault.LOSE:
                    self.answer(500)
                elif fault is Fault.RESET:
                    self.close_connection = True
                elif fault is Fault.HANG:
                    self.connection.recv(1)
                    self.close_connection = True
                else:
                    self.send_response_only(found.status)
                    for name, value in found.getheaders():
                        if name.lower() not in {"transfer-encoding", "connection", "content-length"}:
                            self.send_header(name, value)
                    length = found.getheader("content-length") if self.command == "HEAD" else len(content)
                    self.send_header("Content-Length", str(length or 0))
                    self.end_headers()
                    self.wfile.write(content)

            def answer(self, status: int) -> None:
                self.send_response_only(status)
                self.send_header("Content-Length", "0")
                self.end_headers()

        for method in ("GET", "HEAD", "PUT", "POST", "DELETE"):
            setattr(Handler, f"do_{method}", Handler.pass_on)
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)

    @property
    def port(self) -> int:
        """Where clients connect."""
        return int(self._server.server_address[1])

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.shutdown()
        self._server.server_close()


def now_and_then(seed: int, share: float, faults: tuple[Fault, ...] = PASSING) -> Plan:
    """Return a plan that lets such a share of all requests fail, in ways and at places that the seed decides."""
    rng = random.Random(seed)
    return lambda _method, _path: rng.choice(faults) if rng.random() < share else None


def first(method: str, fault: Fault, times: int = 1) -> Plan:
    """Return a plan that lets the first requests of a method fail."""
    left = [times]

    def plan(asked: str, _path: str) -> Fault | None:
        if asked != method or left[0] == 0:
            return None
        left[0] -= 1
        return fault

    return plan
