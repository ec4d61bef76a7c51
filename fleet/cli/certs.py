"""``fleet certs``: a site's authority, and a certificate for each identity on its bus, in one folder."""

from __future__ import annotations

import os
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import get_args

import click

from fleet.cli.output import Output, with_output
from fleet.config.certificates import (
    CertificateAndKey,
    Identity,
    issue_pair,
    make_authority,
    read_identity,
)
from fleet.config.endpoints import COMMON_NAME, PERSON, PERSONS, Role
from fleet.host.edge.certificate_expiry import ending

AUTHORITY = "ca"
REVOKED = "revoked"
LONGEST_DAYS = 825  # limit of common libraries
ROLES = (*(role for role in get_args(Role) if role not in PERSONS), PERSON)

folder_option = click.option(
    "-d",
    "--dir",
    "folder",
    default="certs",
    show_default=True,
    type=click.Path(file_okay=False, path_type=Path),
    help="The folder of the site's certificates.",
)
days_option = click.option(
    "--days",
    default=365,
    show_default=True,
    type=click.IntRange(1, LONGEST_DAYS),
    help="Days until it expires.",
)


@click.group()
def certs() -> None:
    """Make and renew the certificates by which edges, workers, consoles and programs know each other.

    All are in one folder, with the authority that signs them. Keep that folder on one computer that is backed
    up and is no edge; copy ca.pem and the two files of its own name to each computer.
    """


@certs.command()
@click.argument("site")
@folder_option
@with_output
def init(out: Output, site: str, folder: Path) -> None:
    """Make the authority of SITE, valid for ten years. Never overwrites one."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise click.ClickException(f"cannot make {folder}: {error.strerror}") from None
    _save(folder, AUTHORITY, make_authority(_checked(site), _now()), new=True)
    out.data({"folder": str(folder), "site": site})
    out.say(f"wrote {folder / 'ca.pem'} and {folder / 'ca.key'}; who has ca.key can make any identity")
    out.note("next: fleet certs issue NAME --as ROLE")


@certs.command()
@click.argument("name")
@click.option("--as", "role", required=True, type=click.Choice(ROLES), help="Its role on the bus.")
@click.option("--host", "hosts", multiple=True, help="Name or address at which others reach it; repeatable.")
@days_option
@folder_option
@with_output
def issue(out: Output, name: str, *, role: str, hosts: tuple[str, ...], days: int, folder: Path) -> None:
    """Make a key and a certificate for NAME: an edge's id, a worker's name, a person, or a name you choose.

    With it, a person commands robots from another computer (fleet send -f FILE), if the edge permits it.
    """
    if _checked(name) in _revoked(folder):
        raise click.ClickException(
            f"{name} is revoked: its old certificate would be accepted again; choose another name"
        )
    until = _now() + timedelta(days=days)
    identity = Identity(name, role, tuple(dict.fromkeys((*hosts, name, "localhost", "127.0.0.1"))), until)
    _save(folder, name, issue_pair(_authority(folder), identity, _now()), new=True)
    _report_written(out, folder, identity)
    given = f"{role}}}" if role != PERSON else "operate}, or view, or admin"
    out.note(
        f"in fleet.yaml of the edges it joins, bus.access: {{{name}: {given}; they take it when they restart"
    )


@certs.command()
@click.argument("name")
@days_option
@folder_option
@with_output
def renew(out: Output, name: str, days: int, folder: Path) -> None:
    """Make a new key and certificate in place of NAME's, for the same role and hosts."""
    if _checked(name) in _revoked(folder):
        raise click.ClickException(f"{name} is revoked")
    before = read_identity(_read(folder / f"{name}.pem"))
    identity = before._replace(until=_now() + timedelta(days=days))
    _save(folder, name, issue_pair(_authority(folder), identity, _now()), new=False)
    _report_written(out, folder, identity)
    out.note("copy both to its computer and restart what uses them; the one before is good until it expires")


@certs.command()
@click.argument("name")
@folder_option
@with_output
def revoke(out: Output, name: str, folder: Path) -> None:
    """Mark NAME as no longer trusted, and say how to enforce it.

    Zenoh reads no revocation lists: edges accept every certificate of their authority until it expires, and
    bus.access decides what its name may do. So a revoked name must be removed from bus.access of every edge,
    and the edges must be restarted; an edge without bus.access continues to trust it.
    """
    _read(folder / f"{_checked(name)}.pem")
    revoked = _revoked(folder) | {name}
    _write(folder / REVOKED, "".join(f"{each}\n" for each in sorted(revoked)).encode(), new=False)
    out.data({"revoked": sorted(revoked)})
    out.say(f"{name} is revoked: it is not issued or renewed again")
    out.note(
        f"IT IS STILL ACCEPTED until {name} is removed from bus.access of every edge, and these are restarted"
    )


@certs.command()
@folder_option
@with_output
def ls(out: Output, folder: Path) -> None:
    """Show every certificate of the site with its expiry."""
    revoked, now = _revoked(folder), _now()
    rows = [(path.stem, read_identity(_read(path))) for path in sorted(folder.glob("*.pem"))]
    if not rows:
        raise click.ClickException(f"there is no certificate in {folder}; begin with: fleet certs init SITE")
    states = {
        stem: "revoked" if identity.name in revoked and stem != AUTHORITY else ending(identity.until, now)
        for stem, identity in rows
    }
    out.data(
        {
            "certificates": [
                {
                    "file": f"{stem}.pem",
                    "name": identity.name,
                    "role": identity.role,
                    "hosts": identity.hosts,
                    "until": identity.until.isoformat(),
                    "state": states[stem] or "good",
                }
                for stem, identity in rows
            ]
        }
    )
    out.table(
        ("name", "role", "until", "state"),
        [
            (identity.name, identity.role, f"{identity.until:%Y-%m-%d}", states[stem] or "good")
            for stem, identity in rows
        ],
    )


def _now() -> datetime:
    """Return the current time."""
    return datetime.now(UTC)


def _checked(name: str) -> str:
    """Return a valid name; raises UsageError for other names."""
    if not COMMON_NAME.fullmatch(name) or name == AUTHORITY:
        raise click.UsageError(
            f"{name!r} is no name for it: letters, digits, and . _ - within; not {AUTHORITY}"
        )
    return name


def _report_written(out: Output, folder: Path, identity: Identity) -> None:
    """Report a written certificate."""
    out.data({"name": identity.name, "role": identity.role, "until": identity.until.isoformat()})
    out.say(f"wrote {folder / identity.name}.pem and .key, good until {identity.until:%Y-%m-%d}")


def _authority(folder: Path) -> CertificateAndKey:
    """Return the site's authority."""
    return CertificateAndKey(_read(folder / f"{AUTHORITY}.pem"), _read(folder / f"{AUTHORITY}.key"))


def _revoked(folder: Path) -> set[str]:
    """Return the revoked names."""
    path = folder / REVOKED
    return set(path.read_text(encoding="utf-8").split()) if path.exists() else set()


def _save(folder: Path, name: str, pair: CertificateAndKey, *, new: bool) -> None:
    """Write a key, readable only by this user, and its certificate."""
    for suffix, _ in _files(pair):
        path = folder / f"{name}.{suffix}"
        if new and path.exists():
            raise click.ClickException(f"{path} is there already; it stays as it is")
    for suffix, content in _files(pair):
        _write(folder / f"{name}.{suffix}", content, new=new)


def _files(pair: CertificateAndKey) -> Iterator[tuple[str, bytes]]:
    """Yield the files of a pair, by suffix."""
    yield "key", pair.key
    yield "pem", pair.certificate


def _write(path: Path, content: bytes, *, new: bool) -> None:
    """Write a file for this user only; an existing one is replaced atomically."""
    place = path if new else path.with_suffix(".new")
    try:
        handle = os.open(place, os.O_WRONLY | os.O_CREAT | (os.O_EXCL if new else os.O_TRUNC), 0o600)
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        if not new:
            place.replace(path)
    except OSError as error:
        raise click.ClickException(f"cannot write {path}: {error.strerror}") from None


def _read(path: Path) -> bytes:
    """Return a file's content."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise click.ClickException(f"cannot read {path}: {error.strerror}") from None
