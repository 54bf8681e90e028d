"""Threads that share out work: results in order, errors of any part, and an end of the threads with the team."""

from __future__ import annotations

import gc
import os
import signal
import threading

import pytest

from spherify.geometry.kernels.team import Team


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("count", [1, 2, 7])
def test_results_in_the_order_of_the_parts(threads, count):
    assert Team(threads).each(lambda part: part * part, range(count)) == [i * i for i in range(count)]


def test_parts_are_done_at_once():
    meeting = threading.Barrier(3)
    places = Team(3).each(lambda _: (meeting.wait(timeout=60), threading.get_ident()), range(3))
    assert len({thread for _, thread in places}) == 3


@pytest.mark.parametrize("bad", [0, 1, 2])
def test_an_error_reaches_the_caller_when_all_are_done(bad):
    done = []

    def work(part):
        if part == bad:
            raise ZeroDivisionError(part)
        done.append(part)

    team = Team(3)
    with pytest.raises(ZeroDivisionError, match=str(bad)):
        team.each(work, range(3))
    assert sorted(done) == [part for part in range(3) if part != bad]
    assert team.each(abs, [-1, -2, -3]) == [1, 2, 3]


def test_the_threads_go_with_the_team():
    before = set(threading.enumerate())
    team = Team(3)
    assert set(threading.enumerate()) == before
    team.each(abs, range(3))
    helpers = set(threading.enumerate()) - before
    assert len(helpers) == 2
    del team
    gc.collect()
    for helper in helpers:
        helper.join(timeout=60)
    assert not any(helper.is_alive() for helper in helpers)


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own():
    team = Team(3)
    team.each(abs, range(3))
    if not (child := os.fork()):
        signal.alarm(60)  # ends it if it waits for threads that stayed behind
        os._exit(0 if team.each(abs, [-1, -2, -3]) == [1, 2, 3] else 1)
    assert os.waitpid(child, 0)[1] == 0
    assert team.each(abs, [-1, -2]) == [1, 2]
