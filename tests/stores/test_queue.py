from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import redis
from celery import Celery

from spherify.jobs.errors import StoreUnavailableError
from spherify.jobs.ids import new_job_id
from spherify.settings import Settings
from spherify.stores import keys
from spherify.stores.connect import open_stores
from spherify.stores.embedded import EmbeddedServer
from spherify.stores.leader import Leadership
from spherify.stores.queue import CeleryJobQueue, broker_url, transport
from tests.jobs.examples import job_spec, mesh_record
from tests.stack import wait_for


@pytest.fixture
def queue(server: EmbeddedServer, client: redis.Redis) -> Iterator[CeleryJobQueue]:
    queue = CeleryJobQueue(server.url)
    yield queue
    queue.close()


def test_what_is_sent_is_pending_until_it_is_delivered(
    server: EmbeddedServer, queue: CeleryJobQueue, client: redis.Redis
) -> None:
    first, second = new_job_id()[0], new_job_id()[0]
    queue.send(first)
    queue.send(second)
    assert queue.pending() == [second, first]
    consumer = Celery(broker=broker_url(server.url), set_as_current=False)
    consumer.conf.broker_transport_options = transport(server.url)
    with consumer.connection() as connection, connection.SimpleQueue(keys.QUEUE) as box:
        message = box.get(timeout=5)
        assert message.headers["id"] == first
        assert queue.pending() == [second]  # what is delivered does not count: see spherify.jobs.orphans
        tag = message.delivery_tag
        client.zadd(keys.UNACKED_INDEX, {tag: 1.0})
        queue.keep(tag)
        assert (client.zscore(keys.UNACKED_INDEX, tag) or 0) > 1.0
        message.ack()
        assert (queue.pending(), queue.length()) == ([second], 1)
        queue.keep(tag)
        assert client.zscore(keys.UNACKED_INDEX, tag) is None
    consumer.close()


def test_messages_of_others_are_counted_and_not_read(queue: CeleryJobQueue, client: redis.Redis) -> None:
    ids = [new_job_id()[0] for _ in range(5)]
    for job_id in ids:
        queue.send(job_id)
    others = ("no JSON", "7", "[]", '{"headers": 1}', '{"headers": {}}', '{"headers": {"id": null}}')
    client.lpush(keys.QUEUE_USUAL, *others)
    assert queue.pending() == [""] * len(others) + ids[::-1]
    assert queue.pending(4, 3) == ["", "", ids[4]]
    assert queue.pending(20, 3) == []
    assert queue.length() == 11


def test_what_waited_before_is_taken_first(
    server: EmbeddedServer, queue: CeleryJobQueue, client: redis.Redis
) -> None:
    usual, ahead = [new_job_id()[0] for _ in range(3)], [new_job_id()[0] for _ in range(2)]
    for job_id in usual:
        queue.send(job_id)
    for job_id in ahead:
        queue.send(job_id, ahead=True)
    order = [*ahead, *usual]
    assert queue.pending() == order[::-1]
    assert [queue.pending(i, 1) for i in range(6)] == [[job_id] for job_id in order[::-1]] + [[]]
    assert queue.pending(1, 3) == order[::-1][1:4]
    assert queue.length() == 5
    consumer = Celery(broker=broker_url(server.url), set_as_current=False)
    consumer.conf.broker_transport_options = transport(server.url)
    with consumer.connection() as connection, connection.SimpleQueue(keys.QUEUE) as box:
        taken = [box.get(timeout=5) for _ in order]
        for message in taken:
            message.ack()
    assert [message.headers["id"] for message in taken] == order
    consumer.close()


def test_a_message_names_its_job_and_nothing_else(queue: CeleryJobQueue, client: redis.Redis) -> None:
    job_id = new_job_id()[0]
    queue.send(job_id)
    assert client.llen(keys.QUEUE_USUAL) == 1
    # Celery's own bindings, and nothing that grows
    known = {keys.QUEUE_USUAL, keys.EPOCH}
    others = [key for key in client.keys("*") if key not in known and not key.startswith("_kombu.binding")]
    assert others == []


@pytest.mark.parametrize(
    ("url", "broker"),
    [
        ("redis://host:6379/3", "redis://host:6379/3"),
        ("unix:///tmp/a.sock", "redis+socket:///tmp/a.sock?virtual_host=0"),
        ("unix:///tmp/a.sock?db=2", "redis+socket:///tmp/a.sock?virtual_host=2"),
    ],
)
def test_addresses_in_celerys_spelling(url: str, broker: str) -> None:
    assert broker_url(url) == broker


@pytest.mark.parametrize("how", ["gone", "silent"])
def test_a_server_that_does_not_answer_is_named_and_nothing_hangs(tmp_path: Path, how: str) -> None:
    with EmbeddedServer(tmp_path / "server") as server:
        stores = open_stores(Settings(redis_url=server.url, data_dir=tmp_path))
        stores.meshes.add(mesh_record())
        job = stores.jobs.add(job_spec())
        stores.queue.send(job.id)
        pid = server.pid
        assert pid is not None
        os.kill(pid, signal.SIGKILL if how == "gone" else signal.SIGSTOP)
        try:
            for use in (
                stores.jobs.counts,
                lambda: stores.jobs.get(job.id),
                lambda: stores.jobs.request_cancel(job.id),
                stores.meshes.find,
                stores.queue.pending,
                lambda: stores.queue.send(job.id),
            ):
                with pytest.raises(StoreUnavailableError):
                    use()
        finally:
            if how == "silent":
                os.kill(pid, signal.SIGCONT)
        if how == "gone":  # it refuses connections before it has ended
            wait_for(lambda: not server.alive)
        server.start()  # the same one goes on, or a new one on the same data
        assert stores.jobs.get(job.id) == job
        assert set(stores.queue.pending()) == {job.id}  # what timed out may have landed
        stores.close()


def no_memory(client: redis.Redis) -> None:
    client.config_set("maxmemory", "1")


def demote(client: redis.Redis) -> None:
    client.replicaof("127.0.0.1", "1")


@pytest.mark.parametrize("refuse", [no_memory, demote])
def test_a_server_that_refuses_for_now_is_named(
    server: EmbeddedServer,
    client: redis.Redis,
    tmp_path: Path,
    refuse: Callable[[redis.Redis], None],
) -> None:
    stores = open_stores(Settings(redis_url=server.url, data_dir=tmp_path))
    stores.meshes.add(mesh_record())
    job = stores.jobs.add(job_spec())
    stores.queue.send(job.id)
    refuse(client)
    try:
        for use in (
            lambda: stores.jobs.add(job_spec()),
            lambda: stores.meshes.add(mesh_record("mesh_" + "1" * 26)),
            lambda: stores.jobs.claim(job.id, "w"),
            lambda: stores.queue.send(job.id),
        ):
            with pytest.raises(StoreUnavailableError):
                use()
    finally:
        client.replicaof("NO", "ONE")
        client.config_set("maxmemory", "0")
    assert stores.jobs.claim(job.id, "w").token == 1
    stores.close()


def test_one_leads_and_another_follows_when_it_resigns(client: redis.Redis) -> None:
    one, two = Leadership(client, "one", lease_s=60), Leadership(client, "two", lease_s=60)
    assert one.acquire()
    assert not two.acquire()
    assert one.acquire()
    two.resign()
    assert one.acquire()
    one.resign()
    assert two.acquire()
