"""The log of the service: lines of JSON on standard error."""

from __future__ import annotations

import datetime as dt
import json
import logging
import sys
import time
from typing import Any


def log_json(**record: Any) -> None:
    """Write one record as a line of JSON to standard error.

    Parameters
    ----------
    **record : object
        Values that JSON can hold; `event` is `request` by default.
    """
    at = dt.datetime.fromtimestamp(time.time(), dt.UTC).replace(tzinfo=None)
    line = {"time": f"{at.isoformat(timespec='milliseconds')}Z", "event": "request", **record}
    sys.stderr.write(json.dumps(line, ensure_ascii=True) + "\n")


class JsonHandler(logging.Handler):
    """Writes records of the HTTP server, of the level with which it is made and above."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write one record."""
        log_json(event="server", level=record.levelname.lower(), message=self.format(record)[:4000])
