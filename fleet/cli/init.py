"""``fleet init``: a commented fleet.yaml and a file for secrets."""

from __future__ import annotations

import os
import pathlib
import re
import uuid
from importlib import resources

import click

from fleet.cli.output import Output, with_output

_UUID = re.compile(r"\b[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}\b")
_SECRETS = """\
# Secrets of fleet.yaml, used there as  !secret name.  Keep this file out of version control.
# fleet refuses to read it when others can (chmod 600).
# cyberwave_token: cw_...
"""


@click.command()
@click.argument("folder", default=".", type=click.Path(file_okay=False))
@with_output
def init(out: Output, folder: str) -> None:
    """Write an example fleet.yaml to begin with.

    Creates fleet.yaml, with new twin uuids, and secrets.yaml (mode 0600) in FOLDER, the current one when left
    out. Never overwrites: an existing fleet.yaml is an error, an existing secrets.yaml is kept.
    """
    place = pathlib.Path(folder)
    example = resources.files("fleet.cli").joinpath("example.yaml").read_text(encoding="utf-8")
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise click.ClickException(f"cannot make {place}: {error.strerror}") from None
    config, secrets = place / "fleet.yaml", place / "secrets.yaml"
    if not _write_new(config, _UUID.sub(lambda _: str(uuid.uuid4()), example), 0o644):
        raise click.ClickException(f"{config} is there already; it stays as it is")
    written = [config]
    if _write_new(secrets, _SECRETS, 0o600):
        written.append(secrets)
    out.data({"written": [str(path) for path in written]})
    for path in written:
        out.say(f"wrote {path}")
    out.note(f"next: fleet check {config}")


def _write_new(path: pathlib.Path, text: str, mode: int) -> bool:
    """Write a new file; return False if it exists."""
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    except FileExistsError:
        return False
    except OSError as error:
        raise click.ClickException(f"cannot write {path}: {error.strerror}") from None
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    return True
