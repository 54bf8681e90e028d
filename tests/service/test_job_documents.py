"""Documents of jobs that are asked for again and again."""

from __future__ import annotations

import dataclasses
import json

from service.job_answers import JobDocuments
from spherify.jobs.model import Job
from tests.jobs.examples import job_spec


def test_a_document_is_made_once_for_what_is_the_same_job() -> None:
    documents = JobDocuments()
    job = Job(job_spec())
    assert documents.job(job.id) is None
    text = documents.document(job)
    assert documents.document(job) is text
    assert documents.job(job.id) is job
    moved = dataclasses.replace(job, queue_position=3)
    assert json.loads(documents.document(moved))["queue"] == {"position": 3}
    assert documents.job(job.id) is moved


def test_the_oldest_make_room() -> None:
    jobs = [Job(job_spec()) for _ in range(4)]
    documents = JobDocuments(most_bytes=3 * (len(JobDocuments().document(jobs[0])) + 2048))
    for job in (jobs[0], jobs[1], jobs[2], jobs[0], jobs[3]):
        documents.document(job)
    assert [job for job in jobs if documents.job(job.id) is None] == [jobs[1]]


def test_one_that_is_too_large_is_not_kept() -> None:
    job = Job(job_spec())
    documents = JobDocuments(most_bytes=100)
    assert json.loads(documents.document(job))["id"] == job.id
    assert documents.job(job.id) is None
