"""Log lines as JSON objects, one a line, with ``job_id`` and ``action`` where they apply."""

from __future__ import annotations

import json
import logging
import sys
import time
from typing import Final

_FIELDS: Final = ("job_id", "action")
_SAID_BETTER: Final = (
    "celery.worker.strategy",
    "celery.app.trace",
)  # "received", "succeeded": the supervisor says more


class JsonLines(logging.Formatter):
    """A record as one line of JSON."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        moment = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        line: dict[str, object] = {
            "time": f"{moment}.{record.msecs:03.0f}Z",
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
            "process": record.process,
        }
        line.update({name: getattr(record, name) for name in _FIELDS if hasattr(record, name)})
        if record.exc_info:
            line["trace"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False)


def set_up(level: int = logging.INFO) -> None:
    """Send everything of this process to standard error in that form."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines())
    logging.basicConfig(level=level, handlers=[handler], force=True)
    for name in _SAID_BETTER:
        logging.getLogger(name).setLevel(max(level, logging.WARNING))
