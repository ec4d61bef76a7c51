"""The people who may log in at a console: a file of names, permissions and password hashes.

Only its user can read the file (0600); it is beside the edge's state, never in fleet.yaml. It is replaced
atomically, so readers see the old or the new content. A running console notices a change at its next access.
"""

from __future__ import annotations

import os
import re
import secrets
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import Final, Literal

import msgspec

from fleet.errors import FleetError, StateNewer
from fleet.model.permission import Permission
from fleet.runtime.decoding import decode_json
from fleet.runtime.state_format import refuse_newer
from fleet.spool.state_folder import create_folder, locked

FILE = "console-people.json"
FORMAT: Final = 1
LONGEST_NAME = 64
MOST = 1000  # people
LARGEST = 1 << 20  # bytes
LOCK_WITHIN = 5.0  # s
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._@-]{0,63}")

PermissionName = Literal["view", "operate", "admin"]


class PeopleError(FleetError):
    """The file of people cannot be read or written, or lacks the requested person."""


class Person(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One person; ``password`` is an argon2id hash."""

    name: str
    permission: PermissionName
    password: str

    @property
    def allowed(self) -> Permission:
        """The person's permission."""
        return Permission[self.permission.upper()]


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The content of the file."""

    people: tuple[Person, ...] = ()
    format: Literal[1] = FORMAT


class _PeopleFormat(msgspec.Struct, frozen=True):
    """The format number of the file; the first format had none."""

    format: int = FORMAT


def name_problem(name: str) -> str:
    """Return why a name is invalid, empty if it is valid."""
    if _NAME.fullmatch(name):
        return ""
    return f"a name has up to {LONGEST_NAME} letters, digits and . _ @ -, and begins with a letter or digit"


def read_people(path: Path) -> dict[str, Person]:
    """Return the people of a file by name, empty without a file; raises PeopleError.

    A file that other users can read or write is refused: they could have added themselves.
    """
    try:
        file = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise PeopleError(f"{path} cannot be read: {error.strerror}") from None
    with os.fdopen(file, "rb") as opened:
        status = os.fstat(opened.fileno())
        if stat.S_IMODE(status.st_mode) & 0o077:
            raise PeopleError(f"others may read or write {path}: chmod 600 {path}")
        if os.geteuid() not in (status.st_uid, 0) and status.st_uid != 0:
            raise PeopleError(f"{path} belongs to another user than this process")
        content = opened.read(LARGEST + 1)
    try:
        if len(content) > LARGEST:
            raise PeopleError(f"{path} has more than {LARGEST} bytes")
        refuse_newer(decode_json(content, _PeopleFormat).format, FORMAT)
        listed = decode_json(content, _File).people
    except StateNewer as error:
        raise PeopleError(f"{path} cannot be used: {error}") from None
    except msgspec.DecodeError as error:
        raise PeopleError(f"{path} is damaged: {error}") from None
    people = {person.name: person for person in listed}
    if len(people) != len(listed) or any(map(name_problem, people)):
        raise PeopleError(f"{path} is damaged: names are wrong or there twice")
    return people


def write_people(path: Path, people: Iterable[Person]) -> None:
    """Replace the file; raises PeopleError."""
    content = msgspec.json.format(msgspec.json.encode(_File(tuple(people))), indent=1)
    draft = path.with_name(f"{path.name}.{secrets.token_hex(4)}")
    try:
        file = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        try:
            with os.fdopen(file, "wb") as opened:
                opened.write(content)
                opened.flush()
                os.fsync(opened.fileno())
            draft.replace(path)
        finally:
            draft.unlink(missing_ok=True)
    except OSError as error:
        raise PeopleError(f"{path} cannot be written: {error.strerror}") from None


def add_person(path: Path, person: Person) -> None:
    """Add a person; raises PeopleError, also for an existing name."""
    create_folder(path.parent)
    with locked(path, within=LOCK_WITHIN):
        people = read_people(path)
        if person.name in people:
            raise PeopleError(f"{person.name} is there already: fleet console people remove, or password")
        if len(people) >= MOST:
            raise PeopleError(f"there are {MOST} people already")
        write_people(path, (*people.values(), person))


def change_person(
    path: Path, name: str, *, permission: PermissionName | None = None, password: str = ""
) -> None:
    """Give a person another permission or (hashed) password; raises PeopleError."""
    create_folder(path.parent)
    with locked(path, within=LOCK_WITHIN):
        people = read_people(path)
        before = _named(people, name, path)
        people[name] = Person(name, permission or before.permission, password or before.password)
        write_people(path, people.values())


def remove_person(path: Path, name: str) -> None:
    """Remove a person; raises PeopleError."""
    create_folder(path.parent)
    with locked(path, within=LOCK_WITHIN):
        people = read_people(path)
        _named(people, name, path)
        del people[name]
        write_people(path, people.values())


def _named(people: dict[str, Person], name: str, path: Path) -> Person:
    """Return a person; raises PeopleError."""
    if name not in people:
        raise PeopleError(f"{path} has no person {name}: fleet console people list")
    return people[name]


class People:
    """The people of a file, always up to date. ``problem``: why none are known, empty if it was read."""

    def __init__(self, path: Path) -> None:
        self.problem = ""
        self._path = path
        self._seen: tuple[int, int, int, int] | None = None
        self._people: dict[str, Person] = {}

    def find(self, name: str) -> Person | None:
        """Return a person by name."""
        self._reload_if_changed()
        return self._people.get(name)

    def knows(self, person: Person) -> bool:
        """Return True if a person is unchanged: same permission, same password."""
        return self.find(person.name) == person

    def is_empty(self) -> bool:
        """Return True if there are no people, so that no login is possible."""
        self._reload_if_changed()
        return not self._people

    def _reload_if_changed(self) -> None:
        """Read the file again if it has changed."""
        try:
            status = self._path.stat()
            seen = (status.st_ino, status.st_mtime_ns, status.st_ctime_ns, status.st_size)
        except OSError:
            seen = (0, 0, 0, 0)
        if seen == self._seen:
            return
        self._seen = seen
        try:
            self._people, self.problem = read_people(self._path), ""
        except PeopleError as error:
            self._people, self.problem = {}, str(error)
