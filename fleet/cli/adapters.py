"""``fleet adapters``: what was found, how far it came, why it failed, and what it can do."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable

import click
import msgspec

from fleet.cli import command_text
from fleet.cli.adapters_new import new
from fleet.cli.adapters_reload import reload
from fleet.cli.output import Output, with_output
from fleet.config.load import registry_for
from fleet.config.text import nearest
from fleet.errors import ConfigError
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


class _ShownByDefault(click.Group):
    """A group that shows when it is told nothing else."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put ``show`` in front of a line that names no command."""
        if not args or (args[0] not in self.commands and args[0] not in ctx.help_option_names):
            args = ["show", *args]
        return super().parse_args(ctx, args)


@click.group(cls=_ShownByDefault)
def adapters() -> None:
    """Show the kinds of robots that can be used, make new ones, reload changed ones.

    Without a command it shows them; with a NAME all that this one takes.
    """


adapters.add_command(new)
adapters.add_command(reload)


@adapters.command("show")
@click.argument("name", required=False)
@file_option
@with_output
def show(out: Output, name: str | None, file: str | None) -> None:
    """Show the kinds of robots that can be used; with its NAME all that one takes.

    Imports every adapter that is installed, and those in a drop-in folder of the fleet file in a process of
    their own. One that failed is shown with the reason; it matters only for the robots that name it.
    """
    plugins = registry_of(file).load_all()
    if name is not None:
        _show(out, _named(name, plugins))
        return
    out.data({"adapters": [_described(plugin) for plugin in plugins]})
    rows = [(plugin.name, plugin.state, _detail(plugin)) for plugin in plugins]
    out.table(("name", "state", "what it takes, or why it failed"), rows)
    if not plugins:
        out.note("no adapter is installed; see docs/how-to/write-an-adapter.md")


def _named(name: str, plugins: Iterable[Plugin]) -> Plugin:
    """Return the plugin of a name; raises ConfigError for one that is not there."""
    found = {plugin.name: plugin for plugin in plugins}
    if name not in found:
        cure = "install its package here, or name the folder of its file in plugins of fleet.yaml"
        raise ConfigError(f"no adapter {name!r}; {nearest(name, found) or cure}")
    return found[name]


def _show(out: Output, plugin: Plugin) -> None:
    """Show one kind of robot: its commands with parameters, units and help."""
    out.data(_described(plugin))
    can = _description(plugin)
    out.say(f"{plugin.name}: {plugin.report or plugin.state} [{plugin.origin}]")
    if can is None:
        return
    takes = [*(["velocity"] if can.drives else []), *(["goals"] if can.navigates else [])]
    limits = ", ".join(f"{name} {value:g}" for name, value in can.limits.items())
    out.say(f"takes {', '.join(takes) or 'commands only'}; limits (m/s, rad/s, m): {limits or 'none'}")
    for command in can.commands:
        out.say("")
        out.say(f"{command.name} {command_text.parameters(command)}".rstrip(" -"))
        command_text.show(out, command)


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
