"""``fleet bundle``: signed bundles of a configuration, for roll-outs to many edges."""

from __future__ import annotations

import os
import time
from datetime import UTC, datetime
from pathlib import Path

import click

from fleet.cli.output import ExitCode, Output, counted, with_output
from fleet.errors import FleetError
from fleet.rollout.bundle import LARGEST, Bundle, BundleError, sign_bundle, verify_bundle
from fleet.rollout.decision import AgentRecord
from fleet.rollout.edge_here import LocalEdge
from fleet.rollout.installation import Installation
from fleet.rollout.making import make as made
from fleet.rollout.settings import FILE, read_settings
from fleet.rollout.signature import by_name, new_key, private_key, public_key

file_path = click.Path(dir_okay=False, path_type=Path)
bundle_argument = click.argument("bundle", type=file_path)


@click.group()
def bundle() -> None:
    """Make, show and install signed bundles: a fleet file and the files that it needs, without secrets."""


@bundle.command()
@click.argument("name")
@with_output
def key(out: Output, name: str) -> None:
    """Make a pair of keys: NAME.key signs bundles, NAME.pub is copied to each edge.

    The owner of NAME.key decides what the edges run. Keep it off the edges.
    """
    pair = new_key()
    for suffix, content in ((".key", pair.pem()), (".pub", pair.public.pem())):
        _write_new(Path(f"{name}{suffix}"), content)
    out.data({"key": pair.public.name, "private": f"{name}.key", "public": f"{name}.pub"})
    out.say(f"wrote {name}.key and {name}.pub: key {pair.public.name}")


@bundle.command("make")
@click.argument("file", default="fleet.yaml", type=file_path)
@click.option("--key", "key_file", required=True, type=file_path, help="The private key for the signature.")
@click.option("--version", required=True, type=click.IntRange(1), help="Higher than that of any before.")
@click.option(
    "--edge", "edges", multiple=True, help="An edge that may install it; repeatable. Left out: its own."
)
@click.option("-o", "into", type=file_path, help="The bundle's file. Left out: EDGE-VERSION.bundle.")
@with_output
def make(
    out: Output, file: Path, *, key_file: Path, version: int, edges: tuple[str, ...], into: Path | None
) -> None:
    """Make a bundle of FILE (fleet.yaml when left out) and the files that it needs.

    It never contains the values of secrets, only their names; a private key, or a secret written in the file
    itself, is refused.
    """
    found = made(file, edges, version, os.environ, time.time())
    address, data = sign_bundle(found.bundle, private_key(_read(key_file)))
    into = into or Path(f"{found.bundle.edges[0]}-{version}.bundle")
    _write_new(into, data)
    for line in found.left_out:
        out.note(f"not in the bundle: {line}")
    _show(out, address, found.bundle, f"wrote {into}")


@bundle.command()
@bundle_argument
@click.option("--trust", required=True, multiple=True, type=file_path, help="A public key; repeatable.")
@with_output
def show(out: Output, bundle: Path, *, trust: tuple[Path, ...]) -> None:
    """Check a bundle as an edge does, and show its contents."""
    address, found = verify_bundle(read_bundle(bundle), by_name(public_key(_read(path)) for path in trust))
    _show(out, address, found, str(bundle))


@bundle.command()
@bundle_argument
@click.option(
    "--into",
    "folder",
    required=True,
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help=f"The folder of the edge, with its {FILE}.",
)
@with_output
def install(out: Output, bundle: Path, *, folder: Path) -> ExitCode:
    """Install the first bundle of an edge; roll-outs bring the later ones.

    The folder needs rollout.yaml with edge and trust, and secrets.yaml if the bundle names secrets.
    """
    settings = read_settings(folder / FILE)
    if settings.edge is None:
        raise click.ClickException(f"{folder / FILE} names no edge: add  edge: NAME")
    installation = Installation(folder)
    installation.lock()
    try:
        if installation.current:
            raise BundleError(f"{folder} has bundle {installation.current[:12]} already: roll out the next")
        address, found = verify_bundle(read_bundle(bundle), settings.trusted())
        if settings.edge not in found.edges:
            raise BundleError(f"{bundle} is for {', '.join(found.edges)}, not for edge {settings.edge}")
        installation.stage(found, address)
        LocalEdge(settings.edge, installation.file_in_use).check(installation.folder_of(address), None)
        installation.save_record(AgentRecord(address, found.version, address, placed=time.time()))
        installation.activate(address)
    finally:
        installation.release()
    out.data({"folder": str(folder), "bundle": address, "version": found.version})
    out.say(f"installed version {found.version}; start it with: fleet run {installation.file_in_use}")
    return ExitCode.OK


def read_bundle(path: Path) -> bytes:
    """Return the bytes of a bundle's file, at most one more than permitted."""
    try:
        with path.open("rb") as file:
            return file.read(LARGEST + 1)
    except OSError as error:
        raise BundleError(f"cannot read {path}: {error.strerror}") from None


def _show(out: Output, address: str, bundle: Bundle, what: str) -> None:
    """Show the contents of a bundle."""
    out.data(
        {
            "bundle": address,
            "version": bundle.version,
            "edges": bundle.edges,
            "files": {name: len(content) for name, content in bundle.files.items()},
            "secrets": bundle.secrets,
            "made": bundle.made,
        }
    )
    made_at = datetime.fromtimestamp(bundle.made, UTC)
    out.say(f"{what}: version {bundle.version}, made {made_at:%Y-%m-%d %H:%M} UTC, address {address[:12]}")
    out.say(f"for {', '.join(bundle.edges)}")
    out.say(f"{counted(len(bundle.files), 'file')}: {', '.join(sorted(bundle.files))}")
    if bundle.secrets:
        out.say(f"secrets that each edge must have: {', '.join(bundle.secrets)}")


def _read(path: Path) -> bytes:
    """Return the content of a key's file."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise BundleError(f"cannot read {path}: {error.strerror}") from None


def _write_new(path: Path, content: bytes) -> None:
    """Write a new file for this user only; raises FleetError if it exists."""
    try:
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(content)
    except FileExistsError:
        raise FleetError(f"{path} is there already; it stays as it is") from None
    except OSError as error:
        raise FleetError(f"cannot write {path}: {error.strerror}") from None
