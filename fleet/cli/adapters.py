"""``fleet adapters``: the adapters, their states, errors and vocabulary."""

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
    """Return the adapters available to a fleet file; without a file, the installed ones.

    Raises ConfigError if the file cannot be read.
    """
    if file is None and not pathlib.Path("fleet.yaml").exists():
        return Registry()
    return registry_for(file or "fleet.yaml")


class _ShownByDefault(click.Group):
    """A group whose default command is ``show``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Insert ``show`` if the line names no command."""
        if not args or (args[0] not in self.commands and args[0] not in ctx.help_option_names):
            args = ["show", *args]
        return super().parse_args(ctx, args)


@click.group(cls=_ShownByDefault)
def adapters() -> None:
    """Show the kinds of robots that can be used, make new ones, reload changed ones.

    Without a command, all kinds are listed; with a NAME, everything about this one.
    """


adapters.add_command(new)
adapters.add_command(reload)


@adapters.command("show")
@click.argument("name", required=False)
@file_option
@with_output
def show(out: Output, name: str | None, file: str | None) -> None:
    """Show the kinds of robots that can be used; with its NAME, everything about one.

    Imports every installed adapter; drop-in files of the fleet file are imported by separate processes. A
    failed adapter is shown with the reason; it affects only the robots that name it.
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
    """Return the plugin of a name; raises ConfigError if there is none."""
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
    """Return the vocabulary of a plugin, or why it failed; and its origin."""
    can = _description(plugin)
    if can is None:
        return f"{plugin.report} [{plugin.origin}]"
    words = [
        *(["velocity"] if can.drives else []),
        *(["goals"] if can.navigates else []),
        *(command.name for command in can.commands),
    ]
    warning = f"; {plugin.report}" if plugin.report else ""
    return f"{', '.join(words) or 'nothing'}{warning} [{plugin.origin}]"


def _description(plugin: Plugin) -> AdapterDescription | None:
    """Return the description of a plugin; None if it failed."""
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
