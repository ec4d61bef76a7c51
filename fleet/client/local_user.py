"""Who asks from this command line: what robots and the history are told, and can only take as claimed."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Mapping
from typing import Any


def local_user(environ: Mapping[str, str] = os.environ) -> str:
    """Return ``user@host``: by the environment, for a directory service may wait, and a stop must not.

    Who became root by sudo is told with the name from before.
    """
    user = environ.get("SUDO_USER") or environ.get("USER") or environ.get("LOGNAME") or f"uid-{os.getuid()}"
    return f"{user}@{socket.gethostname()}"


def stamped(message: dict[str, Any]) -> bytes:
    """Return a message that is sent now, by who runs this command."""
    return json.dumps(
        {**message, "session_id": local_user(), "timestamp": time.time()}, allow_nan=False
    ).encode()
