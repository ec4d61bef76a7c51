"""``fleet adapters new``: a package for a new kind of robot, with tests that pass from the start."""

from __future__ import annotations

import importlib.util
import keyword
import pathlib
import re
import shlex
import sys
from collections.abc import Mapping
from importlib import resources
from types import MappingProxyType
from typing import NamedTuple

import click

from fleet.cli.output import Output, with_output
from fleet.plugins.registry import Registry

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", re.ASCII)
_LONGEST = 40
_RESERVED = frozenset({"new", "reload", "show", "test", "testing"})


class _TemplateKind(NamedTuple):
    """Texts of the templates that depend on the kind."""

    extra: str
    speech: str
    link: str
    attempt: str


_TRY_TCP = """Try it: `python -m @package@.simulator` prints a link; put it into fleet.yaml, then `fleet run`.

"""
KINDS: Mapping[str, _TemplateKind] = MappingProxyType(
    {
        "frame": _TemplateKind("[serial]", "lines or packets", "serial:/dev/ttyUSB0?baud=115200", _TRY_TCP),
        "can": _TemplateKind("[can]", "frames", "can:socketcan:can0", _TRY_TCP),
        "sdk": _TemplateKind(
            "",
            "SDK",
            "sim                         # or its host name",
            "Try it: `link: sim`, then `fleet run`.\n\n",
        ),
    }
)
_FILES: Mapping[str, str] = MappingProxyType(
    {
        "pyproject.toml": "common/pyproject.toml",
        "README.md": "common/README.md",
        "@package@/__init__.py": "common/init.py",
        "@package@/py.typed": "",
        "@package@/adapter.py": "@kind@/adapter.py",
        "@package@/simulator.py": "@kind@/simulator.py",
        "tests/test_contract.py": "@kind@/test_contract.py",
        "tests/test_adapter.py": "@kind@/test_adapter.py",
    }
)
"""Files of a package with their templates; an empty template is an empty file."""


@click.command("new")
@click.argument("name")
@click.option(
    "--kind",
    type=click.Choice(list(KINDS)),
    default="frame",
    show_default=True,
    help="frame: lines or packets over serial, TCP or UDP. can: frames on a CAN bus. sdk: a vendor's SDK.",
)
@click.option(
    "--into",
    type=click.Path(file_okay=False, path_type=pathlib.Path),
    default=pathlib.Path(),
    help="The folder in which the package's folder is created. [the current one]",
)
@with_output
def new(out: Output, name: str, kind: str, into: pathlib.Path) -> None:
    """Write a package for a new kind of robot.

    Creates the folder NAME with an adapter, a simulated robot, tests (the contract that the host relies on,
    and some of its own), pyproject.toml with the entry point, and a README. All tests pass as they are:
    replace the example's protocol by your robot's. NAME is the name in fleet.yaml (adapter: NAME): small
    letters, digits and hyphens. Never overwrites: a folder of this name is an error.

    For example:  fleet adapters new hexapod --kind can
    """
    _check_name(name)
    place = into / name
    files = package(name, kind)
    try:
        into.mkdir(parents=True, exist_ok=True)
        place.mkdir()
    except FileExistsError:
        raise click.ClickException(f"{place} is there already; it stays as it is") from None
    except OSError as error:
        raise click.ClickException(f"cannot make {place}: {error.strerror}") from None
    for path, text in files.items():
        _write(place / path, text)
    out.data({"written": [str(place / path) for path in files], "adapter": name})
    for path in files:
        out.say(f"wrote {place / path}")
    python, install = _next_programs()
    out.note(f"next: cd {place} && {install} -e '.[test]' && {python} -m pytest")


def package(name: str, kind: str) -> dict[str, str]:
    """Return the files of a package by their paths in its folder."""
    about = KINDS[kind]
    tokens = {
        "try": about.attempt,
        "name": name,
        "package": f"fleet_{name.replace('-', '_')}",
        "class": "".join(part.capitalize() for part in name.split("-")),
        "kind": kind,
        "extra": about.extra,
        "speech": about.speech,
        "link": about.link,
    }
    folder = resources.files("fleet.cli").joinpath("scaffold")
    found = {}
    for path, template in _FILES.items():
        text = ""
        if template:
            text = folder.joinpath(f"{_filled(template, tokens)}.txt").read_text(encoding="utf-8")
        found[_filled(path, tokens)] = _filled(text, tokens)
    return found


def _filled(text: str, tokens: Mapping[str, str]) -> str:
    """Return a text with its ``@tokens@`` replaced."""
    for token, value in tokens.items():
        text = text.replace(f"@{token}@", value)
    return text


def _next_programs() -> tuple[str, str]:
    """Return this environment's interpreter and installer; environments made by uv have no pip."""
    if importlib.util.find_spec("pip"):
        return "python", "python -m pip install"
    python = shlex.quote(sys.executable)
    return python, f"uv pip install --python {python}"


def _check_name(name: str) -> None:
    """Refuse a name that is taken, or invalid in fleet.yaml, Python or a package index."""
    if _NAME.fullmatch(name) is None or len(name) > _LONGEST:
        raise click.BadParameter(
            f"{name!r}: use small letters, digits and single hyphens, beginning with a letter, "
            f"at most {_LONGEST} of them, like six-wheeler",
            param_hint="NAME",
        )
    if name in _RESERVED or keyword.iskeyword(name):
        raise click.BadParameter(f"{name!r} is a word of its own here; choose another", param_hint="NAME")
    taken = Registry().names()
    if name in taken:
        raise click.BadParameter(
            f"there is an adapter {name!r} already; installed are {', '.join(taken)}", param_hint="NAME"
        )


def _write(path: pathlib.Path, text: str) -> None:
    """Write a new file."""
    try:
        path.parent.mkdir(exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise click.ClickException(f"cannot write {path}: {error.strerror}") from None
