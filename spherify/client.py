"""A client of the service's REST interface: what `spherify submit` and `spherify demo` speak through."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from ipaddress import ip_address
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Final, Self, TypeVar
from uuid import uuid4

import httpx

POLL_S: Final = 0.25
PATIENCE_S: Final = 15.0  # a service may be restarted behind its address
IN_PROGRESS: Final = "idempotency-in-progress"
_CHUNK: Final = 1 << 16
T = TypeVar("T")


class ServiceError(Exception):
    """The service did not do what it was asked; the message says why."""


class UnreachableError(ServiceError):
    """Nobody answers at this address."""


class InvalidAddressError(UnreachableError):
    """It is no address of a service."""


class RefusedError(ServiceError):
    """A problem document (RFC 9457).

    Attributes:
        status: of the answer.
        slug: the kind of problem, such as ``mesh-not-closed``.
        errors: each wrong value, with ``pointer``, ``code`` and ``detail``.

    """

    def __init__(self, status: int, document: Mapping[str, Any]) -> None:
        self.status = status
        self.slug = str(document.get("type", "")).rpartition("/")[2]
        self.errors: list[dict[str, Any]] = list(document.get("errors") or ())
        detail = document.get("detail") or document.get("title") or f"it answered {status}"
        super().__init__(str(detail))


class Client:
    """A session with one service; a context manager, safe to share between threads.

    Raises `InvalidAddressError` unless the address is one of http or https.
    """

    def __init__(self, url: str, *, timeout_s: float = 60.0) -> None:
        self.url = url.rstrip("/")
        self._met = False  # has it ever answered?
        try:
            self._http = httpx.Client(
                base_url=self.url,
                timeout=httpx.Timeout(timeout_s, connect=5.0),
                trust_env=not _on_this_machine(self.url),  # no proxy leads back here
            )
        except httpx.InvalidURL as e:
            raise InvalidAddressError(f"{url!r} is no address: {e}") from e
        if self._http.base_url.scheme not in {"http", "https"} or not self._http.base_url.host:
            raise InvalidAddressError(f"{url!r} is no address: write it as in http://127.0.0.1:8000")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._http.close()

    def submit(
        self, path: Path, fields: Mapping[str, str | list[str]], *, key: str | None = None
    ) -> dict[str, Any]:
        """Upload a mesh and start a job on it; returns the job. Raises `ServiceError`, OSError.

        A service that has answered before, and is away, is waited for: under a key of its own the request makes one
        job however often it is sent. A pipe can be read once.

        Args:
            path: of the file.
            fields: of the form beside it.
            key: names the request, so that whoever sends it under this name within a day is given the job that it
                made then, unless that failed, was cancelled or deleted: then there is a new one.

        """

        def upload(name: str) -> tuple[dict[str, Any], bool]:
            def once() -> tuple[dict[str, Any], bool]:
                with path.open("rb") as file:
                    return self._begun(path.name, file, fields, name)

            return self._patiently(once, away=self._met) if path.is_file() else once()

        if key is not None:
            try:
                job, made_before = upload(key)
                if not made_before or self._of_use(job["id"]):
                    return job
            except RefusedError as e:
                if e.status != httpx.codes.GONE and e.slug != "idempotency-key-reused":
                    raise
        return upload(str(uuid4()))[0]

    def submit_content(
        self, name: str, content: bytes, fields: Mapping[str, str | list[str]]
    ) -> dict[str, Any]:
        """Do the same with the content of a file of that name, which need not be there; raises `ServiceError`."""
        key = str(uuid4())

        def once() -> dict[str, Any]:
            return self._begun(name, content, fields, key)[0]

        return self._patiently(once, away=self._met)

    def job(self, job_id: str) -> dict[str, Any]:
        """Return a job as it is now; raises `ServiceError`."""
        return self._json("GET", f"/v1/jobs/{job_id}")

    def jobs(self, tag: str | None = None) -> list[dict[str, Any]]:
        """Return the newest jobs, at most 50, those with a tag if one is named; raises `ServiceError`."""
        items: list[dict[str, Any]] = self._json("GET", "/v1/jobs", params={"tag": tag} if tag else {})[
            "items"
        ]
        return items

    def info(self) -> dict[str, Any]:
        """Return what the service says about itself; raises `ServiceError`."""
        return self._json("GET", "/v1/info")

    def cancel(self, job_id: str) -> dict[str, Any]:
        """Ask for the end of a job; raises `ServiceError`."""
        return self._json("POST", f"/v1/jobs/{job_id}/cancel")

    def follow(
        self, job_id: str, *, meanwhile: Callable[[], None] = lambda: None
    ) -> Iterator[dict[str, Any]]:
        """Yield a job now, after each change, and at its end; raises `ServiceError`, and what `meanwhile` raises.

        Args:
            job_id: of the job.
            meanwhile: called before each look.

        """
        etag = ""
        while True:
            meanwhile()
            answer = self._send("GET", f"/v1/jobs/{job_id}", headers={"If-None-Match": etag} if etag else {})
            if answer.status_code != httpx.codes.NOT_MODIFIED:
                etag = answer.headers.get("etag", "")
                job: dict[str, Any] = answer.json()
                yield job
                if job["done"]:
                    return
            time.sleep(POLL_S)

    def snapshots(self, job_id: str) -> list[dict[str, Any]]:
        """Return the kept states of a job with their figures, ascending; raises `ServiceError`."""
        items: list[dict[str, Any]] = self._json("GET", f"/v1/jobs/{job_id}/snapshots")["items"]
        return items

    def download(self, job_id: str, which: int | str, mesh_format: str, target: Path) -> None:
        """Save one kept state as a file, whole or not at all; raises `ServiceError`, OSError."""
        part = target.with_name(target.name + ".part")
        try:
            self._patiently(lambda: self._fetch(f"/v1/jobs/{job_id}/snapshots/{which}.{mesh_format}", part))
            part.replace(target)
        finally:
            part.unlink(missing_ok=True)

    def _fetch(self, path: str, target: Path) -> None:
        with self._reaching(), self._http.stream("GET", path) as answer:
            if answer.is_error:
                answer.read()
                raise _refused(answer)
            with target.open("wb") as file:
                for chunk in answer.iter_bytes(_CHUNK):
                    file.write(chunk)

    def _begun(
        self, name: str, file: IO[bytes] | bytes, fields: Mapping[str, str | list[str]], key: str
    ) -> tuple[dict[str, Any], bool]:
        """Return a job, and whether it had been made before."""
        upload = {"file": (name, file, "application/octet-stream")}
        answer = self._send(
            "POST", "/v1/jobs", files=upload, data=dict(fields), headers={"Idempotency-Key": key}
        )
        return answer.json(), answer.headers.get("idempotent-replayed") == "true"

    def _of_use(self, job_id: str) -> bool:
        """Whether a job is at work or has a result; what collapsed once would again."""
        try:
            job = self.job(job_id)
        except RefusedError as e:
            if e.status in {httpx.codes.GONE, httpx.codes.NOT_FOUND}:
                return False
            raise
        return job["status"] not in {"failed", "cancelled"} or job["stop_reason"] == "collapsed"

    def _json(self, method: str, path: str, **options: Any) -> dict[str, Any]:  # noqa: ANN401 (httpx's own)
        document: dict[str, Any] = self._send(method, path, **options).json()
        return document

    def _send(self, method: str, path: str, **options: Any) -> httpx.Response:  # noqa: ANN401 (httpx's own)
        def once() -> httpx.Response:
            with self._reaching():
                answer = self._http.request(method, path, **options)
            self._met = True
            if answer.is_error:
                raise _refused(answer)
            return answer

        return self._patiently(once) if method == "GET" else once()

    @staticmethod
    def _patiently(ask: Callable[[], T], *, away: bool = True) -> T:
        """Ask again for a while if the service says that it is at it; or is not there or not ready, if ``away``."""
        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                return ask()
            except UnreachableError:
                if not away or time.monotonic() > deadline:
                    raise
            except RefusedError as e:
                later = e.slug == IN_PROGRESS or (away and e.status == httpx.codes.SERVICE_UNAVAILABLE)
                if not later or time.monotonic() > deadline:
                    raise
            time.sleep(POLL_S)

    def _reaching(self) -> _Reaching:
        return _Reaching(self.url)


class _Reaching:
    """Turns what httpx raises on the way into a sentence."""

    def __init__(self, url: str) -> None:
        self.url = url

    def __enter__(self) -> None:
        return

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, httpx.ConnectError | httpx.ConnectTimeout):
            raise UnreachableError(
                f"nobody answers at {self.url}: start a service with `spherify up`, or name another with --url"
            ) from error
        if isinstance(error, httpx.HTTPError | httpx.InvalidURL):
            raise UnreachableError(
                f"the connection to {self.url} broke: {error or type(error).__name__}"
            ) from error


def _refused(answer: httpx.Response) -> RefusedError:
    try:
        document = answer.json()
    except ValueError:
        document = {}
    return RefusedError(answer.status_code, document if isinstance(document, dict) else {})


def _on_this_machine(url: str) -> bool:
    host = httpx.URL(url).host
    try:
        return ip_address(host).is_loopback
    except ValueError:  # a name
        return host == "localhost"
