"""Many clients that hold a connection each and ask now and then: what ten thousand open pages do."""

from __future__ import annotations

import asyncio
import random
from dataclasses import dataclass, field
from time import monotonic


@dataclass
class Polled:
    """What came back: seconds of each answer, and whatever was no 200."""

    seconds: list[float] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def percentile(self, share: float) -> float:
        """Return the time within which this share of all answers came."""
        return sorted(self.seconds)[int(share * (len(self.seconds) - 1))]


@dataclass(frozen=True)
class Clients:
    """So many clients ask for a path of a server, each every `period_s` seconds, so many times."""

    host: str
    port: int
    path: str
    clients: int
    period_s: float
    rounds: int

    def poll(self) -> Polled:
        """Let them ask, each on a connection of its own, evenly spread over the period."""
        polled = Polled()
        asyncio.run(self._all(polled))
        return polled

    async def _all(self, polled: Polled) -> None:
        rng = random.Random(15)
        async with asyncio.TaskGroup() as group:
            for _ in range(self.clients):
                group.create_task(self._one(polled, rng.uniform(0, self.period_s)))

    async def _one(self, polled: Polled, delay_s: float) -> None:
        request = f"GET {self.path} HTTP/1.1\r\nHost: x\r\n\r\n".encode()
        await asyncio.sleep(delay_s)
        reader: asyncio.StreamReader | None = None
        writer: asyncio.StreamWriter | None = None
        for _ in range(self.rounds):
            began = monotonic()
            try:
                if reader is None or writer is None or reader.at_eof():  # closed, as idle ones are
                    if writer is not None:
                        writer.close()
                    reader, writer = await asyncio.open_connection(self.host, self.port)
                writer.write(request)
                head = await reader.readuntil(b"\r\n\r\n")
                length = int(head.lower().partition(b"content-length: ")[2].split(b"\r\n")[0])
                await reader.readexactly(length)
            except (OSError, asyncio.IncompleteReadError) as e:
                polled.errors.append(repr(e))
                reader = None
                continue
            polled.seconds.append(monotonic() - began)
            if not head.startswith(b"HTTP/1.1 200 "):
                polled.errors.append(head.decode("latin-1").splitlines()[0])
            await asyncio.sleep(max(0.0, self.period_s - (monotonic() - began)))
        if writer is not None:
            writer.close()
