"""Text of fleet.yaml for authorized users, without its secrets."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping
from pathlib import Path

from fleet.config.masking import Masking, kept_secrets, secrets_in
from fleet.config.yaml import SECRETS, read
from fleet.errors import FleetError

log = logging.getLogger(__name__)

LONGEST = 256 * 1024  # characters


def shown_configuration(file: Path, environ: Mapping[str, str] = os.environ) -> str:
    """Return a fleet file and its includes as text, with secrets masked; blocks.

    An invalid file is shown, too; the text is empty if it cannot be read at all.
    """
    try:
        document = read(file, environ)
    except (FleetError, OSError) as error:
        log.warning("%s cannot be shown: %s", file, error)
        return ""
    masking = Masking(secrets_in(document, kept_secrets(file.parent / SECRETS), environ))
    parts = [f"# {Path(name).name}\n{masking.config(lines)}" for name, lines in document.lines.items()]
    text = "\n".join(parts)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}\n# the rest is left out\n"
