"""``fleet adapters``: what was found, how far it came, why it failed, and what it can do."""

from __future__ import annotations

import pathlib
from typing import Any

import click
import msgspec

from fleet.cli.output import Output, with_output
from fleet.config.load import registry_for
from fleet.host.make import capabilities
from fleet.registry import Plugin, Registry

file_option = click.option(
    "-f",
    "--file",
    type=click.Path(),
    help="The fleet file whose drop-in folders count as well. [fleet.yaml, if there is one]",
)


def registry_of(file: str | None) -> Registry:
    """Return the adapters that a fleet file can use; without one, those that are installed.

    Raises ConfigError when the file cannot be read.
    """
    if file is None and not pathlib.Path("fleet.yaml").exists():
        return Registry()
    return registry_for(file or "fleet.yaml")


@click.command()
@file_option
@with_output
def adapters(out: Output, file: str | None) -> None:
    """Show the kinds of robots that can be used.

    Imports every adapter that is installed or lies in a drop-in folder of the fleet file. One that failed
    is shown with the reason; it matters only for the robots that name it.
    """
    plugins = registry_of(file).load_all()
    out.data({"adapters": [_described(plugin) for plugin in plugins]})
    rows = [(plugin.name, plugin.state, _detail(plugin)) for plugin in plugins]
    out.table(("name", "state", "what it takes, or why it failed"), rows)
    if not plugins:
        out.note("no adapter is installed; see docs/write-an-adapter.md")


def _detail(plugin: Plugin) -> str:
    """Return what the plugin takes, or why it failed; and where it comes from."""
    if plugin.adapter is None:
        return f"{plugin.report} [{plugin.origin}]"
    can = capabilities(plugin.adapter)
    words = [
        *(["velocity"] if can.drives else []),
        *(["goals"] if can.navigates else []),
        *sorted(can.commands),
    ]
    return f"{', '.join(words) or 'nothing'} [{plugin.origin}]"


def _described(plugin: Plugin) -> dict[str, Any]:
    """Return everything about a plugin, for programs."""
    described: dict[str, Any] = {
        "name": plugin.name,
        "state": plugin.state,
        "origin": plugin.origin,
        "report": plugin.report,
    }
    if plugin.adapter is None:
        return described
    can = capabilities(plugin.adapter)
    commands = [
        {
            "name": spec.name,
            "summary": spec.summary,
            "timeout": spec.timeout,
            "safe": spec.safe,
            "moves": spec.moves,
            "parameters": list(spec.parameters.__struct_fields__),
            "ranges": {name: str(bounds) for name, bounds in spec.ranges.items()},
        }
        for spec in sorted(can.commands.values(), key=lambda spec: spec.name)
    ]
    return {
        **described,
        "class": f"{plugin.adapter.__module__}:{plugin.adapter.__qualname__}",
        "drives": can.drives,
        "navigates": can.navigates,
        "limits": msgspec.to_builtins(can.limits.model_dump(exclude_none=True)),
        "commands": commands,
    }
