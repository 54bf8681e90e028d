"""Where the log lines of a worker process go."""

from __future__ import annotations

import logging
from typing import Final

from spherify.logs import json_handler

_SAID_BETTER: Final = ("celery.worker.strategy", "celery.app.trace")  # by the supervisor, with the reason


def set_up(level: int = logging.INFO) -> None:
    """Send everything of this process to standard error as JSON lines."""
    logging.basicConfig(level=level, handlers=[json_handler()], force=True)
    for name in _SAID_BETTER:
        logging.getLogger(name).setLevel(max(level, logging.WARNING))
