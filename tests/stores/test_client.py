"""A server that accepts and never answers: who comes after the first few does not wait for it."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import spherify.stores.client
from spherify.jobs.errors import StoreUnavailableError
from spherify.stores.client import connect, reachable
from spherify.stores.embedded import EmbeddedServer
from tests.faults.chaos import ChaosProxy
from tests.stack import wait_for


def answers(ping: Callable[[], object]) -> bool:
    try:
        with reachable():
            return bool(ping())
    except StoreUnavailableError:
        return False


@pytest.mark.parametrize("break_s", [60.0, 0.05])
def test_the_wait_for_a_hanging_server_is_spared_until_it_is_worth_a_try(
    server: EmbeddedServer, monkeypatch: pytest.MonkeyPatch, break_s: float
) -> None:
    monkeypatch.setattr(spherify.stores.client, "_BREAK_S", break_s)
    with ChaosProxy(server.url) as proxy:
        client = connect(proxy.url, timeout_s=0.1)
        assert client.ping()
        proxy.hang()
        for _ in range(3):
            with pytest.raises(StoreUnavailableError, match="Timeout"), reachable():
                client.ping()
        if break_s > 1:
            with pytest.raises(StoreUnavailableError, match="a moment ago"), reachable():
                client.ping()
        else:
            proxy.heal()
            wait_for(lambda: answers(client.ping))
            assert client.ping()
        client.close()
