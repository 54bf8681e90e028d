"""Log lines as JSON objects, one a line: the same form from the service and from the workers.

A line carries ``request_id`` when it belongs to a request, and ``job_id`` and ``action`` where they apply.
"""

from __future__ import annotations

import json
import logging
import sys
import time
from contextvars import ContextVar
from typing import Final

current_request: ContextVar[str | None] = ContextVar("current_request", default=None)
_ENCODE: Final = json.JSONEncoder(ensure_ascii=False).encode
_FIELDS: Final = ("action", "job_id", "mesh_id", "method", "path", "status", "ms")


class JsonLines(logging.Formatter):
    """A record as one line of JSON; whatever a client sent is escaped."""

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
        if (request_id := current_request.get()) is not None:
            line["request_id"] = request_id
        line.update({name: getattr(record, name) for name in _FIELDS if hasattr(record, name)})
        if record.exc_info:
            line["trace"] = self.formatException(record.exc_info)
        return _ENCODE(line)


def json_handler() -> logging.Handler:
    """Return a handler that writes such lines to standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines())
    return handler
