"""Where the log lines of an API process go."""

from __future__ import annotations

import logging

from spherify.logs import json_handler


def set_up() -> None:
    """Send our lines of this process to standard error, unless somebody configured logging already."""
    if logging.getLogger().handlers:
        return
    handler = json_handler()
    for name in ("service", "spherify"):
        logger = logging.getLogger(name)
        logger.setLevel(logging.INFO)
        logger.handlers = [handler]
