"""``python -m worker``: the worker with the options that belong to it; more may follow, as Celery's."""

from __future__ import annotations

import sys
import warnings
from typing import Final

from celery.platforms import SecurityWarning

from worker.app import app

OPTIONS: Final = (
    "--quiet",  # no banner: the log is one JSON object a line
    "worker",
    "--without-gossip",
    "--without-mingle",
    "--without-heartbeat",
    "--loglevel=INFO",
)

if __name__ == "__main__":
    # Celery warns a worker of root of pickled messages; this one takes JSON only.
    warnings.filterwarnings("ignore", category=SecurityWarning)
    app.worker_main([*OPTIONS, *sys.argv[1:]])
