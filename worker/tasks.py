"""The one task."""

from __future__ import annotations

from celery import Task
from celery.exceptions import Reject

from spherify.stores.queue import TASK
from worker import lifecycle
from worker.app import app


@app.task(name=TASK, bind=True)  # type: ignore[untyped-decorator] # celery has no types
def run_job(self: Task, job_id: str) -> None:
    """Do one delivery of a job; a worker that is shutting down leaves it to another one."""
    if lifecycle.stopping():
        raise Reject("shutting down", requeue=True)
    delivery_tag = self.request.properties["delivery_tag"]
    lifecycle.supervisor().run(job_id, self.request.hostname, lambda: lifecycle.keep(delivery_tag))
