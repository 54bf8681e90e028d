"""What every store of Idempotency-Keys must do: the twin in memory, and the real server."""

from __future__ import annotations

import time

import pytest
import redis

from spherify.jobs.errors import KeyReusedError, RequestInProgressError
from spherify.jobs.repeats import KEPT_S, Beginning, RepeatStore
from spherify.stores.memory_repeats import MemoryRepeatStore
from spherify.stores.repeats import RedisRepeatStore


@pytest.fixture(params=["memory", "redis"])
def repeats(request: pytest.FixtureRequest) -> RepeatStore:
    if request.param == "memory":
        return MemoryRepeatStore(time.time)
    client: redis.Redis = request.getfixturevalue("client")
    return RedisRepeatStore(client)


def test_a_request_is_carried_out_once_and_then_answered(repeats: RepeatStore) -> None:
    assert repeats.begin("k", "f", "one") == Beginning("one")
    with pytest.raises(RequestInProgressError):
        repeats.begin("k", "f", "two")
    with pytest.raises(KeyReusedError):
        repeats.begin("k", "g", "two")
    repeats.answered("k", "an answer")
    assert repeats.begin("k", "f", "two") == Beginning("one", "an answer")
    with pytest.raises(KeyReusedError):
        repeats.begin("k", "g", "two")


def test_what_may_have_taken_effect_keeps_its_identity(repeats: RepeatStore) -> None:
    repeats.begin("k", "f", "one")
    repeats.free("k")
    assert repeats.begin("k", "f", "two") == Beginning("one")
    repeats.forget("k")
    assert repeats.begin("k", "g", "three") == Beginning("three")
    repeats.answered("unknown", "nobody asked")
    assert repeats.begin("unknown", "f", "four") == Beginning("four")


def test_a_lost_key_is_taken_up_for_the_rest_of_its_day(repeats: RepeatStore) -> None:
    now = time.time()
    assert repeats.remember("k", "f", "one", now - 60)
    assert not repeats.remember("k", "g", "two", now)
    with pytest.raises(KeyReusedError):
        repeats.begin("k", "g", "two")
    assert repeats.begin("k", "f", "two") == Beginning("one")
    assert not repeats.remember("old", "f", "one", now - KEPT_S - 1)
    assert repeats.begin("old", "g", "two") == Beginning("two")
