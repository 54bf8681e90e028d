"""The fork server does for any caller what it does as a program: nothing it needs is there in that case only."""

from __future__ import annotations

import subprocess
import sys

from tests.stack import ROOT

PROGRAM = """
import os, socket
from worker.fork_server import serve

def obey(orders, events):
    os.write(events, b"obeyed " + os.read(orders, 9))
    os._exit(0)

ours, requests = socket.socketpair()
fate, told = socket.socketpair()
orders, order = os.pipe()
events, event = os.pipe()
os.write(order, b"the order")
socket.send_fds(ours, [b"r"], [orders, event, told.fileno()])
ours.close()
os.close(event)
serve(requests, obey)
print(os.read(events, 99).decode())
"""


def test_a_runner_obeys_with_what_the_server_was_given() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=ROOT, capture_output=True, text=True, check=False, timeout=30
    )
    assert (done.stdout, done.stderr) == ("obeyed the order\n", "")
