"""``python -m worker``: the worker with the options that belong to it; more may follow, as Celery's."""

from __future__ import annotations

import sys
from typing import Final

from worker.app import app

OPTIONS: Final = ("worker", "--without-gossip", "--without-mingle", "--without-heartbeat", "--loglevel=INFO")

if __name__ == "__main__":
    app.worker_main([*OPTIONS, *sys.argv[1:]])
