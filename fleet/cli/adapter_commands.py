"""Commands of ``fleet`` from packages of adapters, by the entry point ``fleet.commands``.

A package names a click command, as in ``can = "fleet_quadruped.cli:can"``. It is imported only when it is
used, and cannot replace a command of ``fleet`` itself.
"""

from __future__ import annotations

import functools
import importlib.metadata
from collections.abc import Mapping
from importlib.metadata import EntryPoint

import click

GROUP = "fleet.commands"


@functools.cache
def adapter_commands() -> Mapping[str, EntryPoint]:
    """Return the entry points of installed packages by command name, sorted."""
    found = importlib.metadata.entry_points(group=GROUP)
    return {point.name: point for point in sorted(found, key=lambda point: (point.name, point.value))}


def package_of(point: EntryPoint) -> str:
    """Return the package of a command."""
    return point.dist.name if point.dist else point.module


def load_command(point: EntryPoint) -> click.Command:
    """Import a command; raises ClickException with the reason if it cannot be loaded."""
    try:
        command = point.load()
    except ModuleNotFoundError as error:
        raise click.ClickException(f"fleet {point.name} needs {error.name}: install its extra") from None
    except (ImportError, AttributeError) as error:
        raise click.ClickException(f"fleet {point.name} of {package_of(point)}: {error}") from None
    if not isinstance(command, click.Command):
        raise click.ClickException(f"fleet {point.name} of {package_of(point)} is no click command")
    return command
