"""Which stage an iteration belongs to, which states are kept, and which rows the time series has."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from spherify.geometry.config import Stage
from spherify.geometry.errors import InvalidConfigError

MAX_SNAPSHOTS: Final = 1000
FIRST_ROWS: Final = (*range(11), 13, 16, 20, 25, 31, 39, 49, 61, 76)  # then distances grow by a quarter
ROWS_AFTERWARDS: Final = 500
LEAST_STRIDE: Final = 20  # a row takes a fifth of an iteration

_FORMS: Final = "write snapshots as a list like 100,500,1000, or every:N, or log:N"


def stage_at(schedule: Sequence[Stage], iteration: int) -> Stage:
    """Return the stage of iteration ``iteration`` (0 is the first), the schedule being cycled."""
    left = iteration % sum(stage.repeat for stage in schedule)
    for stage in schedule:
        if left < stage.repeat:
            return stage
        left -= stage.repeat
    raise AssertionError("an iteration modulo the length of the schedule lies within it")


@dataclass(frozen=True, slots=True)
class SnapshotPlan:
    """The states that are kept.

    Attributes:
        iterations: ascending, without repetition, with 0 and the last one.

    """

    iterations: tuple[int, ...]

    @classmethod
    def parse(cls, plan: str | Iterable[int], iterations: int) -> SnapshotPlan:
        """Read a plan for a run of at most ``iterations`` iterations.

        Args:
            plan: ``"100,500,1000"``, ``[100, 500, 1000]``; ``"every:100"``: each hundredth; ``"log:12"``: 12
                states whose distances grow geometrically from 1 to the last. Empty: only the ends.
            iterations: the last iteration.

        Raises:
            InvalidConfigError: another form, a number outside 0 … iterations, or more than MAX_SNAPSHOTS states.

        """
        chosen = (
            _parsed(plan.strip(), iterations)
            if isinstance(plan, str)
            else [_whole(number) for number in plan]
        )
        for number in chosen:
            if not 0 <= number <= iterations:
                raise InvalidConfigError(
                    f"snapshot {number} lies outside 0 … {iterations}: ask for more iterations or leave it out"
                )
        kept = tuple(sorted({0, iterations, *chosen}))
        if len(kept) > MAX_SNAPSHOTS:
            raise InvalidConfigError(
                f"the plan keeps {len(kept)} snapshots and at most {MAX_SNAPSHOTS} are kept: space them wider"
            )
        return cls(kept)

    def __contains__(self, iteration: int) -> bool:
        return iteration in self.iterations


def is_recorded(iteration: int, iterations: int, plan: SnapshotPlan) -> bool:
    """Whether the time series of a run of at most ``iterations`` has a row at ``iteration``.

    FIRST_ROWS, then each ceil(iterations / ROWS_AFTERWARDS)-th, but at most each LEAST_STRIDE-th, the snapshots and
    the last: a rule of these numbers only, so that a resumed run records the same rows. The state a run ends with
    before that has a row as well.
    """
    if iteration == iterations or iteration in plan:
        return True
    return iteration in FIRST_ROWS if iteration <= FIRST_ROWS[-1] else iteration % _stride(iterations) == 0


def recorded_iterations(iterations: int, plan: SnapshotPlan) -> tuple[int, ...]:
    """All iterations for which `is_recorded` holds, ascending."""
    start = (row for row in FIRST_ROWS if row <= iterations)
    stride = _stride(iterations)
    afterwards = range((FIRST_ROWS[-1] // stride + 1) * stride, iterations + 1, stride)
    return tuple(sorted({*start, *afterwards, *plan.iterations, iterations}))


def _stride(iterations: int) -> int:
    """Return the iterations between two rows, after those of the start."""
    return max(-(-iterations // ROWS_AFTERWARDS), LEAST_STRIDE)


def _parsed(text: str, iterations: int) -> list[int]:
    """Read the written forms of a plan."""
    if not text:
        return []
    if match := re.fullmatch(r"(every|log)\s*:\s*(\d{1,12})", text):
        count = int(match[2])
        if count == 0:
            raise InvalidConfigError(f"{match[1]}:0 keeps nothing: name a number of 1 or more")
        if match[1] == "log":
            if count > MAX_SNAPSHOTS:
                raise InvalidConfigError(
                    f"log:{count} names {count} snapshots and at most {MAX_SNAPSHOTS} are kept"
                )
            return _geometric(count, iterations)
        kept = -(-iterations // count) + 1  # with both ends
        if kept > MAX_SNAPSHOTS:
            raise InvalidConfigError(
                f"every:{count} keeps {kept} snapshots and at most {MAX_SNAPSHOTS} are kept: "
                f"every:{-(-iterations // (MAX_SNAPSHOTS - 1))} is the densest"
            )
        return list(range(count, iterations + 1, count))
    if re.fullmatch(r"\d{1,12}(\s*[,;\s]\s*\d{1,12})*", text):
        return [int(number) for number in re.findall(r"\d+", text)]
    raise InvalidConfigError(f"{text[:60]!r} is no plan of snapshots: {_FORMS}")


def _geometric(count: int, iterations: int) -> list[int]:
    """``count`` iterations 1 … ``iterations`` in nearly constant ratio; fewer where they would repeat."""
    if iterations < 1:
        return []
    if count == 1:
        return [iterations]
    ratio = float(iterations) ** (1 / (count - 1))
    return [min(round(ratio**k), iterations) for k in range(count)]


def _whole(number: object) -> int:
    """Return a whole number as it is, and refuse everything else."""
    if isinstance(number, bool) or not isinstance(number, int):
        raise InvalidConfigError(f"{number!r} is no iteration: {_FORMS}")
    return number
