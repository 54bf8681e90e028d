"""Kombu's Redis transport with one mend: a message that cannot be acknowledged does not keep its slot.

A channel fetches while it holds fewer messages than it may. Kombu tells the server that a message is done and then
frees its slot; when the server cannot be told, as it has just been killed, Celery logs that and goes on, and the slot
stays taken. With all slots taken nothing is read from the connection any more, so that its death goes unnoticed, and
the worker is connected, alive and idle for ever. Here the slot is free in any case: the next fetch meets the dead
connection, and Celery makes a new one. The message itself comes back after its visibility timeout and is dropped.
"""

from __future__ import annotations

from typing import Final

from kombu.transport import TRANSPORT_ALIASES
from kombu.transport import redis as kombu_redis
from kombu.transport.virtual import QoS as Slots

SCHEMES: Final = ("redis", "rediss")


class QoS(kombu_redis.QoS):
    """Which messages a channel holds; see the module."""

    def ack(self, delivery_tag: str) -> None:
        """Say that a message is done, and free its slot even if nobody hears it."""
        try:
            super().ack(delivery_tag)  # type: ignore[no-untyped-call] # kombu has no types
        finally:
            Slots.ack(self, delivery_tag)  # type: ignore[no-untyped-call] # as above

    def reject(self, delivery_tag: str, requeue: bool = False) -> None:
        """Give a message back or up, and free its slot even if nobody hears it."""
        try:
            super().reject(delivery_tag, requeue=requeue)  # type: ignore[no-untyped-call] # as above
        finally:
            Slots.ack(self, delivery_tag)  # type: ignore[no-untyped-call] # as above


class Channel(kombu_redis.Channel):
    """A channel whose slots are those above."""

    QoS = QoS


class Transport(kombu_redis.Transport):
    """A transport whose channels are those above."""

    Channel = Channel


def install() -> None:
    """Let addresses of this process that begin with redis: or rediss: mean this transport."""
    for scheme in SCHEMES:
        TRANSPORT_ALIASES[scheme] = f"{__name__}:{Transport.__name__}"
