"""Building of a bundle from a fleet file and the files that it names, without secrets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import msgspec

from fleet.backup.configuration import collect
from fleet.config.load import sections_of
from fleet.config.masking import Masking, kept_secrets, secrets_in
from fleet.config.yaml import SECRETS, Document, read, secret_names
from fleet.rollout.bundle import FLEET_FILE, FORMAT, Bundle, BundleError
from fleet.version import __version__


class BuiltBundle(msgspec.Struct, frozen=True):
    """A built bundle; ``left_out`` lists files that the fleet file names and the bundle does not contain."""

    bundle: Bundle
    left_out: tuple[str, ...]


def make(
    file: Path, edges: Iterable[str], version: int, environ: Mapping[str, str], now: float
) -> BuiltBundle:
    """Build the bundle of a fleet file for these edges, or for the edge of the file if there are none.

    ``now`` is in Unix seconds. Raises BundleError, InvalidConfig.
    """
    config = sections_of(file, environ)
    document = read(file, environ)
    masking = Masking(secrets_in(document, kept_secrets(file.parent / SECRETS), environ))
    found = collect(file, document, config, masking)
    _refuse_secrets(document, found.files, file)
    if found.keys:
        raise BundleError(
            f"{found.keys[0]} is a private key, which stays on its edge: name it by its absolute path there"
        )
    if found.telling:
        raise BundleError(
            f"{found.telling[0]} has the value of a secret in it; take it out, and write  !secret NAME  in "
            f"{FLEET_FILE} where it is needed"
        )
    files = dict(found.files)
    if file.name != FLEET_FILE:
        if FLEET_FILE in files:
            raise BundleError(f"{file} names another {FLEET_FILE}; rename that")
        files[FLEET_FILE] = files.pop(file.name)
    bundle = Bundle(
        FORMAT,
        version,
        tuple(edges) or (config.edge.id,),
        files,
        tuple(secret_names(file.parent / SECRETS)),
        __version__,
        now,
    )
    return BuiltBundle(bundle, tuple(found.left_out))


def _refuse_secrets(document: Document, files: Mapping[str, bytes], file: Path) -> None:
    """Refuse a configuration file that contains a secret literally; raises BundleError."""
    for name, lines in document.lines.items():
        inside = Path(name).resolve().relative_to(file.parent.resolve()).as_posix()
        shown = files[inside].decode().splitlines()
        for number, (line, masked) in enumerate(zip(lines, shown, strict=False), 1):
            if line.rstrip() != masked:
                raise BundleError(
                    f"{name}:{number}: a secret stands here; write  !secret NAME  and put its value into "
                    f"{SECRETS} of each edge"
                )
