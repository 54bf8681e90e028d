"""The least Celery can do for a job: a task that says it was run, with the options our worker has.

``python -m benchmarks.bare_celery`` is a worker of it; BENCH_BROKER names the server.
"""

from __future__ import annotations

import os
import sys
import warnings
from typing import Final

from celery import Celery
from celery.platforms import SecurityWarning
from redis import Redis

from spherify.stores.queue import broker_url, transport

URL: Final = os.environ.get("BENCH_BROKER", "redis://127.0.0.1:6379/1")
DONE: Final = "bench:done"

app: Final = Celery("bare", broker=broker_url(URL))
app.conf.update(
    task_default_queue="bench",
    task_serializer="json",
    accept_content=["json"],
    result_backend=None,
    task_ignore_result=True,
    task_acks_late=True,
    task_reject_on_worker_lost=True,
    worker_prefetch_multiplier=1,
    worker_send_task_events=False,
    worker_enable_remote_control=False,
    broker_connection_retry_on_startup=True,
    broker_transport_options=transport(URL),
)
_results: Final[Redis] = Redis.from_url(URL)


@app.task(name="bench.say")  # type: ignore[untyped-decorator] # celery has no types
def say(number: int) -> None:
    """Say that this one was run."""
    _results.rpush(DONE, number)


if __name__ == "__main__":
    warnings.filterwarnings(
        "ignore", category=SecurityWarning
    )  # of a worker of root; this one takes JSON only
    app.worker_main(
        ["--quiet", "worker", "--without-gossip", "--without-mingle", "--without-heartbeat", *sys.argv[1:]]
    )
