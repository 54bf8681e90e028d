"""What a page of another site can make a browser do here: load what anybody may see, and nothing else.

There are no users, so whoever reaches the service may use it; but a browser also acts for the author of any page it
shows. Two ways are closed. A page of another site may have a form or a script send something: browsers mark that in
`Sec-Fetch-Site` (W3C Fetch Metadata), which no page can change and which programs do not send. Or the name of that site
may come to resolve to our address, so that the browser takes us for it (DNS rebinding): then that name is in `Host`.
"""

from __future__ import annotations

from ipaddress import ip_address
from typing import Final

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from service.problems import ProblemError
from service.server import PROBES
from spherify.settings import Settings

SAFE: Final = frozenset({"GET", "HEAD", "OPTIONS", "TRACE"})  # RFC 9110, 9.2.1
ELSEWHERE: Final = frozenset({"cross-site", "same-site"})  # the same site is any port of this machine
ANY: Final = "*"
_MOST: Final = 80  # characters of theirs that are said back


class Gate:
    """Refuses what another site makes a browser send, and names that are not this service's.

    Args:
        app: answers the rest.
        settings: names the origins that may send all the same, and the names.
        loopback: the name under which the service listens for this machine alone: any other must be set then. None
            where it listens for others, too, and may have names it does not know.

    """

    def __init__(self, app: ASGIApp, settings: Settings, loopback: str | None) -> None:
        self._app = app
        self._origins = frozenset(settings.cors_origins)
        names = {name_of(name) for name in settings.allowed_hosts}
        checked = names if loopback is None else names | {loopback.lower()}
        self._names = None if not checked or ANY in names else checked

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] == "http":
            headers = Headers(scope=scope)
            if self._names is not None and scope["path"] not in PROBES:
                self._check_host(headers.get("host", ""))
            if scope["method"] not in SAFE and headers.get("sec-fetch-site") in ELSEWHERE:
                self._check_origin(headers.get("origin", ""))
        await self._app(scope, receive, send)

    def _check_host(self, host: str) -> None:
        name = name_of(host)
        if name and not (is_loopback(name) or _is_address(name) or name in (self._names or ())):
            raise ProblemError(
                "unknown-host",
                f"this service does not go by the name {name[:_MOST]!r}: ask for it by its address, or let whoever "
                "runs it put the name into SPHERIFY_ALLOWED_HOSTS",
            )

    def _check_origin(self, origin: str) -> None:
        if not self._origins & {origin, ANY}:
            raise ProblemError(
                "cross-site",
                f"a page of {origin[:_MOST] or 'another site'} had a browser send this, and it is not one of "
                "SPHERIFY_CORS_ORIGINS, the origins whose pages may",
            )


def name_of(host: str) -> str:
    """Return the name or address in a `Host` header, without the port, in lower case."""
    bracketed, _, _ = host.removeprefix("[").partition("]")
    name = bracketed if host.startswith("[") else host.partition(":")[0]
    return name.lower().rstrip(".")


def is_loopback(name: str) -> bool:
    """Whether a name or address is that of the machine itself, whatever a server of names may say."""
    if name == "localhost" or name.endswith(".localhost"):  # RFC 6761, 6.3
        return True
    return _is_address(name) and ip_address(name).is_loopback


def _is_address(name: str) -> bool:
    """Whether no server of names is asked for it, who could say that it is this machine's."""
    try:
        ip_address(name)
    except ValueError:
        return False
    return True
