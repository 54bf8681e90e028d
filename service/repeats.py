"""`Idempotency-Key`: a POST that is sent again is carried out once, and answered alike (an IETF draft; Stripe has it).

The key is a name for one request: the operation and the content, whatever bytes a form library made of it. Only
what took effect is kept; a request that was refused may be mended and sent again under its key.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Annotated, Any, Final

from anyio import to_thread
from fastapi import Depends, Header, Request, Response

from service.problems import problem_of
from spherify.jobs.codec import dumps
from spherify.jobs.errors import JobGoneError, JobNotFoundError, StoreUnavailableError
from spherify.jobs.ids import new_job_id
from spherify.jobs.model import RequestKey
from spherify.jobs.ports import JobStore
from spherify.jobs.repeats import RepeatStore


@dataclass(frozen=True, slots=True)
class Identity:
    """What a request is to make: the identity of a new job, and the key it was asked for under, to be kept with it."""

    job_id: str
    request: RequestKey | None = None


REPLAYED: Final = "Idempotent-Replayed"
_KEPT_HEADERS: Final = ("content-type", "location", "etag", "retry-after", "cache-control")
log = logging.getLogger(__name__)

_Key = Annotated[
    str | None,
    Header(
        min_length=1,
        max_length=255,
        pattern=r"^[\x21-\x7e]+$",
        description="A name for this request, new for each: a UUID. Sent again with the same key within a day, the "
        "request is not carried out again but answered as before, with `Idempotent-Replayed: true`; with 410 where the "
        "job that it made was deleted since.",
    ),
]


async def _checked(idempotency_key: _Key = None) -> None:
    """Describe the header, and refuse what is no key; `once` reads it."""


IDEMPOTENT: Final = Depends(_checked)


async def once(
    request: Request,
    repeats: RepeatStore,
    content: Any,  # noqa: ANN401 (whatever JSON holds)
    act: Callable[[Identity], Awaitable[Response]],
    *,
    jobs: JobStore | None = None,
) -> Response:
    """Carry a request out, unless it was before.

    Args:
        request: tells the operation, and its key; without one it is simply carried out.
        repeats: where keys are kept.
        content: what it asks, JSON-ready: equal for requests that mean the same.
        act: does it, under the identity it is given.
        jobs: where what it makes is recorded, if that is a job.

    Raises:
        KeyReusedError, RequestInProgressError, StoreUnavailableError: nothing was done.
        JobGoneError: it was carried out before, and the job has been deleted since.

    """
    identity, _ = new_job_id()
    key = request.headers.get("idempotency-key")
    if key is None:
        return await act(Identity(identity))
    name, fingerprint = _hash(f"{request.method} {request.url.path} {key}"), _hash(dumps(content))
    begun = await to_thread.run_sync(repeats.begin, name, fingerprint, identity)
    if begun.answer is not None:
        await _made(jobs, begun.identity)
        log.info("answered before", extra={"action": "replay"})
        return _load(begun.answer)
    try:
        made = begun.identity != identity and await _made(jobs, begun.identity)
        answer = await act(Identity(begun.identity, RequestKey(name, fingerprint)))
    except Exception as e:
        problem = problem_of(e)
        # What was begun before and is gone took effect, before the records were lost: the key must not make it anew.
        gone = isinstance(e, JobGoneError) and begun.identity != identity
        refused = problem is not None and problem.type.is_refusal and not gone
        await _tell(repeats.forget if refused else repeats.free, name)
        raise
    await _tell(lambda name: repeats.answered(name, _dump(answer)), name)
    if made:  # whoever made it was answered, or had gone; the answer itself was lost
        answer.headers[REPLAYED] = "true"
    return answer


async def _made(jobs: JobStore | None, job_id: str) -> bool:
    """Whether the job that a request is to make is there already; raises `JobGoneError` if it was deleted."""
    if jobs is None:
        return False
    try:
        await to_thread.run_sync(jobs.get, job_id)
    except JobNotFoundError:
        return False
    return True


async def _tell(write: Callable[[str], None], name: str) -> None:
    """Write down how it went; a server that is away now will let the key go by itself, and its identity holds."""
    try:
        await to_thread.run_sync(write, name)
    except StoreUnavailableError as e:
        log.warning("the key of a request is not kept: %s", e, extra={"action": "replay"})


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _dump(answer: Response) -> str:
    headers = {name: value for name, value in answer.headers.items() if name in _KEPT_HEADERS}
    return json.dumps([answer.status_code, headers, bytes(answer.body).decode()])


def _load(text: str) -> Response:
    status, headers, body = json.loads(text)
    return Response(body.encode(), status, headers | {REPLAYED: "true"})
