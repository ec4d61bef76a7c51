"""Identity of the user of this command line; robots and the history record it as claimed, not proven."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Mapping
from typing import Any


def local_user(environ: Mapping[str, str] = os.environ) -> str:
    """Return ``user@host`` from the environment: a directory service may block, and a stop must not wait.

    Under sudo it is the name of the original user.
    """
    user = environ.get("SUDO_USER") or environ.get("USER") or environ.get("LOGNAME") or f"uid-{os.getuid()}"
    return f"{user}@{socket.gethostname()}"


def stamped(message: dict[str, Any]) -> bytes:
    """Return an encoded message with the user of this command and the present time."""
    return json.dumps(
        {**message, "session_id": local_user(), "timestamp": time.time()}, allow_nan=False
    ).encode()
