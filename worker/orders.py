"""What supervisor and runner say to each other: one order down the pipe, then events up it, a line of JSON each.

order      everything the runner needs to know
ready      pid: signals are heard from now on
anew       what stays of all that earlier attempts told, where states that they left are of another run
snapshot   a file is durable
report     progress, and rows since the last report
end        the outcome; everything is durable
handed-on  stopped at a checkpoint
failed     code and detail; trying again would not help
"""

from __future__ import annotations

import json
import signal
from dataclasses import asdict, dataclass
from typing import Any, Final

CANCEL_SIGNAL: Final = signal.SIGUSR1  # stop for good, and keep the state as a snapshot
HAND_ON_SIGNAL: Final = signal.SIGTERM  # stop so that somebody else may go on


@dataclass(frozen=True, slots=True)
class Order:
    """What a runner is to do.

    Attributes:
        token: fencing token of the attempt, part of the names of its files.
        data_dir: folder of the blob store.
        memory_bytes: limit of the runner's address space.
        deadline_s: seconds from the moment it has the order; then it keeps the state it is at, and ends.
        limit_s: seconds that all attempts together may take, to be named at the deadline.
        checkpoint_s: seconds between checkpoints.
        engine: who computes a new run; None is the default.
        threads: it computes with.
        blobs: where files are kept, see `spherify.stores.files.open_blobs`.

    """

    job_id: str
    token: int
    data_dir: str
    memory_bytes: int
    deadline_s: float
    limit_s: float
    checkpoint_s: float
    engine: str | None = None
    threads: int = 1
    blobs: str = "folder"

    def line(self) -> bytes:
        """Return the order as it goes down the pipe."""
        return json.dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def parse(cls, line: bytes) -> Order:
        """Read what `line` wrote."""
        return cls(**json.loads(line))


def event_line(event: str, **content: Any) -> bytes:  # noqa: ANN401 (whatever JSON holds)
    """Return an event as it goes up the pipe."""
    return json.dumps({"event": event, **content}).encode() + b"\n"
