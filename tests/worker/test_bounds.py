"""Settings with which a worker could not work are refused when it starts."""

from __future__ import annotations

import pytest
from annotated_types import Ge, Le
from pydantic import ValidationError

from spherify.settings import Settings
from spherify.stores.queue import VISIBILITY_S
from worker.supervisor import FENCE_SHARE, LOOK_S, TICK_S


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("SPHERIFY_LEASE_S", "0.9", "greater than or equal to 1"),
        ("SPHERIFY_HEARTBEAT_S", "31", "less than or equal to 30"),
        ("SPHERIFY_HEARTBEAT_S", "0", "greater than 0"),
    ],
)
def test_times_out_of_bounds_are_refused(
    monkeypatch: pytest.MonkeyPatch, name: str, value: str, says: str
) -> None:
    monkeypatch.setenv(name, value)
    with pytest.raises(ValidationError, match=says):
        Settings()


def test_the_shortest_lease_outlasts_a_look_that_is_a_tick_late() -> None:
    (least,) = (it.ge for it in Settings.model_fields["lease_s"].metadata if isinstance(it, Ge))
    assert isinstance(least, int)
    assert least * FENCE_SHARE > LOOK_S + TICK_S


def test_the_rarest_heartbeats_may_get_lost_before_the_queue_delivers_again() -> None:
    (most,) = (it.le for it in Settings.model_fields["heartbeat_s"].metadata if isinstance(it, Le))
    assert isinstance(most, int)
    assert 4 * most <= VISIBILITY_S
    assert f"{VISIBILITY_S} s" in str(Settings.model_fields["heartbeat_s"].description)
