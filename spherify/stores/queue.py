"""Job ids through Celery: the one place outside of the worker that knows it.

Only a hint: kombu pops a message and books it as delivered in two round trips, and what dies between them is
gone. `spherify.jobs.orphans` compares `CeleryJobQueue.pending` with the records, and sends again.
"""

from __future__ import annotations

import json
import time
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

from celery import Celery
from kombu.exceptions import OperationalError

from spherify.jobs.errors import StoreUnavailableError
from spherify.stores import keys
from spherify.stores.client import Scripts, connect, reachable

TASK: Final = "spherify.run_job"
VISIBILITY_S: Final = 120  # refreshed by the heartbeat, so that jobs of hours are delivered once
_AHEAD, _USUAL = 0, 1  # kombu's priorities: a list each, and all of the first before any of the second
TRANSPORT: Final = {
    "visibility_timeout": VISIBILITY_S,
    "priority_steps": [_AHEAD, _USUAL],
    "unacked_key": keys.UNACKED,
    "unacked_index_key": keys.UNACKED_INDEX,
    "unacked_mutex_key": keys.UNACKED_MUTEX,
    "unacked_restore_interval": 10,
    "unacked_restore_throttle": 1,
    "socket_keepalive": True,
    "retry_on_timeout": False,
}
"""Transport options that every producer and consumer must share: the shortest visibility would win."""

_BOUNDED: Final = {"max_retries": 1, "interval_start": 0, "interval_step": 0.1, "interval_max": 0.2}


class CeleryJobQueue:
    """A `spherify.jobs.ports.JobQueue`; may be shared by threads."""

    def __init__(self, redis_url: str, *, timeout_s: float = 0.5) -> None:
        self._client = connect(redis_url, timeout_s=timeout_s)
        self._scripts = Scripts(self._client)
        self._celery = Celery("spherify", broker=broker_url(redis_url), set_as_current=False)
        self._celery.conf.update(
            task_default_queue=keys.QUEUE,
            task_serializer="json",
            task_publish_retry_policy=_BOUNDED,
            broker_transport_options={
                **transport(redis_url),
                **_BOUNDED,
                "socket_timeout": timeout_s,
                "socket_connect_timeout": timeout_s,
            },
        )

    def send(self, job_id: str, *, ahead: bool = False) -> None:
        """Send one id; raises `StoreUnavailableError` within 2 s when the broker does not answer.

        Args:
            job_id: what to send.
            ahead: of those that were not: for a job that has stood in the queue before.

        """
        priority = _AHEAD if ahead else _USUAL
        try:
            with reachable():
                self._celery.send_task(
                    TASK, args=(job_id,), task_id=job_id, ignore_result=True, priority=priority
                )
        except OperationalError as e:
            raise StoreUnavailableError(f"the queue does not answer: {e}") from e

    def pending(self, start: int = 0, count: int = 1000) -> list[str]:
        """Return ids in the queue, the next one last, `count` at most from a place on; "" for a message of others."""
        messages: list[str] = self._scripts(
            "pending", [keys.QUEUE_USUAL, keys.QUEUE], [start, count], common=False
        )
        return [_job_of(message) for message in messages]

    def length(self) -> int:
        """Return how many messages wait to be delivered."""
        with reachable(), self._client.pipeline(transaction=True) as pipe:
            pipe.llen(keys.QUEUE_USUAL)
            pipe.llen(keys.QUEUE)
            return sum(pipe.execute())

    def keep(self, delivery_tag: str) -> None:
        """Say that a delivered message is still being worked on, so that it is not delivered again.

        The visibility timeout counts from a score that kombu sets once; this sets it anew. Should kombu rename
        its key, the lease still keeps a second worker out.
        """
        with reachable():
            self._client.zadd(keys.UNACKED_INDEX, {delivery_tag: time.time()}, xx=True)

    def close(self) -> None:
        """Close the connections."""
        self._celery.close()
        self._client.close()


def _job_of(message: str) -> str:
    """Return the job that a message names, "" for one that is not ours."""
    try:
        name = json.loads(message)["headers"]["id"]
    except (ValueError, LookupError, TypeError):
        return ""
    return name if isinstance(name, str) else ""


def broker_url(redis_url: str) -> str:
    """Return the address in Celery's spelling, which differs for unix sockets."""
    parts = urlsplit(redis_url)
    if parts.scheme != "unix":
        return redis_url
    database = parse_qs(parts.query).get("db", ["0"])[0]
    return f"redis+socket://{parts.path}?virtual_host={database}"


def transport(redis_url: str) -> dict[str, Any]:
    """Return `TRANSPORT` as this address allows it: a unix socket takes no TCP options."""
    unix = urlsplit(redis_url).scheme == "unix"
    return {name: value for name, value in TRANSPORT.items() if not (unix and name == "socket_keepalive")}
