"""``fleet adapters``: what was found, how far it came, why it failed, and what it can do."""

from __future__ import annotations

import pathlib

import click
import msgspec

from fleet.cli.output import Output, with_output
from fleet.config.load import registry_for
from fleet.host.workers.drop_in_inspector import described
from fleet.plugins.probe import AdapterDescription
from fleet.plugins.registry import Plugin, Registry

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

    Imports every adapter that is installed, and those in a drop-in folder of the fleet file in a process of
    their own. One that failed is shown with the reason; it matters only for the robots that name it.
    """
    plugins = registry_of(file).load_all()
    out.data({"adapters": [_described(plugin) for plugin in plugins]})
    rows = [(plugin.name, plugin.state, _detail(plugin)) for plugin in plugins]
    out.table(("name", "state", "what it takes, or why it failed"), rows)
    if not plugins:
        out.note("no adapter is installed; see docs/write-an-adapter.md")


def _detail(plugin: Plugin) -> str:
    """Return what the plugin takes, or why it failed; and where it comes from."""
    can = _description(plugin)
    if can is None:
        return f"{plugin.report} [{plugin.origin}]"
    words = [
        *(["velocity"] if can.drives else []),
        *(["goals"] if can.navigates else []),
        *(command.name for command in can.commands),
    ]
    return f"{', '.join(words) or 'nothing'} [{plugin.origin}]"


def _description(plugin: Plugin) -> AdapterDescription | None:
    """Return what a plugin is; None for one that failed."""
    if plugin.adapter is not None:
        return described(plugin.name, plugin.adapter, schema=False)
    return plugin.description


def _described(plugin: Plugin) -> dict[str, object]:
    """Return everything about a plugin, for programs."""
    about: dict[str, object] = {
        "name": plugin.name,
        "state": plugin.state,
        "origin": plugin.origin,
        "report": plugin.report,
    }
    can = _description(plugin)
    if can is None:
        return about
    return {
        **about,
        "class": can.cls,
        "drives": can.drives,
        "navigates": can.navigates,
        "limits": can.limits,
        "commands": [msgspec.to_builtins(command) for command in can.commands],
    }
