"""``fleet console people``: the people who may log in at the console of an edge from other computers."""

from __future__ import annotations

import sys
from typing import cast

import click

from fleet.cli.console_login import people_file
from fleet.cli.output import Output, with_output
from fleet.config.load import sections_of
from fleet.console.child import EXTRA, is_installed
from fleet.console.people import (
    PermissionName,
    Person,
    add_person,
    change_person,
    name_problem,
    read_people,
    remove_person,
)
from fleet.model.permission import Permission

file_option = click.option(
    "-f", "--file", default="fleet.yaml", show_default=True, type=click.Path(), help="The edge's fleet file."
)
WORDS = [each.word for each in Permission]
ENDS = "its sessions end now"


@click.group()
def people() -> None:
    """Say who may log in at the console from other computers (console.listen in the fleet file).

    Each person has a name, a permission and a password, which is kept as an argon2id hash, in a file for the
    edge's user only. Run it as that user. A running console applies changes at once.
    """


@people.command()
@click.argument("name")
@click.option("--permission", type=click.Choice(WORDS), default="view", show_default=True)
@file_option
@with_output
def add(out: Output, name: str, *, permission: str, file: str) -> None:
    """Add NAME; asks for the password, or reads it from standard input.

    view: see everything. operate: also command robots. admin: also change them. Everybody may stop robots.
    """
    if problem := name_problem(name):
        raise click.ClickException(problem)
    path = people_file(sections_of(file))
    add_person(path, Person(name, cast("PermissionName", permission), _hashed_password()))
    out.data({"name": name, "permission": permission, "file": str(path)})
    out.say(f"{name} may log in, with the permission {permission}")


@people.command()
@click.argument("name")
@file_option
@with_output
def remove(out: Output, name: str, *, file: str) -> None:
    """Remove NAME, and end the person's sessions."""
    remove_person(people_file(sections_of(file)), name)
    out.data({"name": name})
    out.say(f"{name} may not log in any more; {ENDS}")


@people.command()
@click.argument("name")
@file_option
@with_output
def password(out: Output, name: str, *, file: str) -> None:
    """Give NAME another password, and end the person's sessions."""
    change_person(people_file(sections_of(file)), name, password=_hashed_password())
    out.data({"name": name})
    out.say(f"{name} has another password; {ENDS}")


@people.command()
@click.argument("name")
@click.argument("permission", type=click.Choice(WORDS))
@file_option
@with_output
def permit(out: Output, name: str, *, permission: str, file: str) -> None:
    """Give NAME another permission, and end the person's sessions."""
    change_person(people_file(sections_of(file)), name, permission=cast("PermissionName", permission))
    out.data({"name": name, "permission": permission})
    out.say(f"{name} has the permission {permission}; {ENDS}")


@people.command("list")
@file_option
@with_output
def list_(out: Output, *, file: str) -> None:
    """Show the people who may log in, with their permissions."""
    path = people_file(sections_of(file))
    found = sorted(read_people(path).values(), key=lambda person: person.name)
    shown = [{"name": person.name, "permission": person.permission} for person in found]
    out.data({"file": str(path), "people": shown})
    if found:
        out.table(("name", "permission"), [(person.name, person.permission) for person in found])
    else:
        out.say(f"no login is possible: there are no people in {path}")


def _hashed_password() -> str:
    """Ask for a password, or read it from standard input; return its hash."""
    if not is_installed():
        raise click.ClickException(EXTRA)
    from fleet.console.passwords import hash_password, password_problem  # noqa: PLC0415 - of the extra

    if sys.stdin.isatty():
        given: str = click.prompt("Password", hide_input=True, confirmation_prompt=True, err=True)
    else:
        given = sys.stdin.readline().rstrip("\r\n")
    if problem := password_problem(given):
        raise click.ClickException(problem)
    return hash_password(given)
