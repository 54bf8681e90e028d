"""Following jobs: one look a quarter of a second at all that somebody follows, shared by everybody who does.

A look asks the store for these jobs in one call, which reads those that have changed. Followers never ask the store
themselves, so that a thousand of them cost it no more than one. While the store does not answer they go on waiting.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Final

from anyio import CapacityLimiter, to_thread

from spherify.jobs.errors import JobGoneError, JobNotFoundError, StoreUnavailableError
from spherify.jobs.model import Job
from spherify.jobs.ports import JobStore

LOOK_S: Final = 0.25
PATIENCE_S: Final = 60.0  # a record that was lost with the server's data may be rebuilt within
log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False, slots=True)
class Sight:
    """A job as it was seen, and what has been made of that for all followers.

    Attributes:
        job: as it was last seen.
        gone: whether it has been deleted since.

    """

    job: Job
    gone: bool = False
    _made: dict[str, str] = field(default_factory=dict)

    def once(self, name: str, make: Callable[[Job], str]) -> str:
        """Return what `make` makes of the job; made once, whoever asks."""
        if name not in self._made:
            self._made[name] = make(self.job)
        return self._made[name]


@dataclass(eq=False, slots=True)
class _Topic:
    """A job that somebody follows."""

    sight: Sight
    followers: int = 0
    missing_s: float = 0.0
    over: bool = False
    changed: asyncio.Event = field(default_factory=asyncio.Event)

    def show(self, sight: Sight) -> None:
        self.sight = sight
        self.wake()

    def wake(self) -> None:
        self.changed.set()
        self.changed = asyncio.Event()


class Following:
    """One follower's view of a job."""

    def __init__(self, watch: Watch, topic: _Topic) -> None:
        self._watch = watch
        self._topic = topic

    @property
    def sight(self) -> Sight:
        """The job as it was last seen."""
        return self._topic.sight

    @property
    def over(self) -> bool:
        """Whether nothing more will be seen, because the service is stopping."""
        return self._watch.closed or self._topic.over

    async def other_than(self, sight: Sight, wait_s: float) -> None:
        """Return once something else than that is to be seen, nothing more will be, or the time is up."""
        try:
            async with asyncio.timeout(wait_s):
                while self.sight is sight and not self.over:
                    await self._topic.changed.wait()
        except TimeoutError:  # the caller looks at what there is
            return


class Watch:
    """Looks at the jobs that are followed, as long as there are any; lives in one event loop."""

    def __init__(self, jobs: JobStore, *, look_s: float = LOOK_S) -> None:
        self._jobs = jobs
        self._look_s = look_s
        self._topics: dict[str, _Topic] = {}
        self._looking: asyncio.Task[None] | None = None
        self._thread = CapacityLimiter(1)  # of its own: busy requests must not hold the looks up
        self.closed = False

    @property
    def followed(self) -> int:
        """How many jobs somebody follows."""
        return len(self._topics)

    @contextmanager
    def following(self, job: Job) -> Iterator[Following]:
        """Follow a job that has just been read."""
        topic = self._topics.setdefault(job.id, _Topic(Sight(job)))
        if job.rev > topic.sight.job.rev:
            topic.show(Sight(job))
        topic.followers += 1
        if self._looking is None and not self.closed:
            self._looking = asyncio.create_task(self._look_on())
        try:
            yield Following(self, topic)
        finally:
            topic.followers -= 1
            if topic.followers == 0 and self._topics.get(job.id) is topic:
                del self._topics[job.id]

    def close(self) -> None:
        """Let every follower go: the service is stopping."""
        self.closed = True
        for topic in self._topics.values():
            topic.wake()

    async def _look_on(self) -> None:
        down = False
        try:
            while self._topics and not self.closed:
                await asyncio.sleep(self._look_s)
                asked = {
                    job_id: topic.sight for job_id, topic in self._topics.items() if not topic.sight.gone
                }
                try:
                    seen = await to_thread.run_sync(self._look, asked, limiter=self._thread)
                except StoreUnavailableError as e:
                    if not down:
                        log.warning("followed jobs are out of sight: %s", e, extra={"action": "watch"})
                    down = True
                    continue
                down = False
                for job_id, sight in seen.items():
                    topic = self._topics.get(job_id)
                    if (
                        topic is not None and topic.sight is asked[job_id]
                    ):  # else a follower has brought a newer one
                        self._show(topic, sight)
        except Exception:  # a fault of ours: followers must not wait for what nobody looks at
            log.exception("nobody looks any more", extra={"action": "watch"})
            for topic in self._topics.values():
                topic.over = True
                topic.wake()
            self._topics.clear()
        finally:
            self._looking = None

    def _show(self, topic: _Topic, sight: Sight | None) -> None:
        topic.missing_s = topic.missing_s + self._look_s if sight is None else 0.0
        if sight is not None:
            topic.show(sight)
        elif topic.missing_s > PATIENCE_S:
            topic.show(replace(topic.sight, gone=True))

    def _look(self, asked: dict[str, Sight]) -> dict[str, Sight | None]:
        """Return what is other than it was; None for a job of which the store knows nothing."""
        seen: dict[str, Sight | None] = {}
        found = self._jobs.get_all({job_id: before.job for job_id, before in asked.items()})
        for job_id, before in asked.items():
            match found[job_id]:
                case Job() as job if job is not before.job:
                    seen[job_id] = Sight(job)
                case JobGoneError():
                    seen[job_id] = replace(before, gone=True)
                case JobNotFoundError():
                    seen[job_id] = None
        return seen
