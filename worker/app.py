"""The Celery application: ``celery -A worker.app worker``, or ``python -m worker`` with the options that belong to it.

Celery carries ids and keeps processes; what a job is and where it stands is in the record. Nothing here imports
the mathematics: that is in the runners.
"""

from __future__ import annotations

from typing import Final

from celery import Celery

from spherify.settings import Settings
from spherify.stores import keys
from spherify.stores.queue import broker_url, transport
from worker import lifecycle
from worker.cpus import available_cpus
from worker.liveness import SignOfLife
from worker.transport import install

settings: Final = Settings()
install()

app: Final = Celery("spherify", broker=broker_url(settings.redis_url), include=["worker.tasks"])
app.conf.update(
    task_default_queue=keys.QUEUE,
    task_serializer="json",
    accept_content=["json"],
    result_backend=None,
    task_ignore_result=True,
    # A message is gone when its job is: a worker that dies before leaves it for another one.
    task_acks_late=True,
    task_reject_on_worker_lost=True,
    task_acks_on_failure=True,
    task_acks_on_timeout=True,
    worker_prefetch_multiplier=1,
    worker_concurrency=max(1, available_cpus() // settings.threads),
    # The token makes a second delivery harmless; a job is not to die with a connection.
    worker_cancel_long_running_tasks_on_connection_loss=False,
    broker_connection_retry_on_startup=True,
    broker_connection_max_retries=None,
    worker_send_task_events=False,
    worker_enable_remote_control=False,
    worker_max_tasks_per_child=None,  # what computes is a process of its own
    worker_hijack_root_logger=False,
    worker_redirect_stdouts=False,
    broker_transport_options={
        **transport(settings.redis_url),
        "socket_timeout": 5,
        "socket_connect_timeout": 2,
        "health_check_interval": 10,
    },
)
app.steps["consumer"].add(SignOfLife)
lifecycle.connect(settings)
