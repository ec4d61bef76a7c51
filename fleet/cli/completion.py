"""Completion of commands, robots and their commands by the shell, and ``fleet completion`` to install it."""

from __future__ import annotations

from collections.abc import Iterable

import click
from click.shell_completion import CompletionItem, get_completion_class

from fleet.cli.output import Output, with_output
from fleet.errors import FleetError

SHELLS = ("bash", "zsh", "fish")
VARIABLE = "_FLEET_COMPLETE"


class RobotName(click.ParamType):  # type: ignore[type-arg]  # generic in newer clicks alone
    """The name of a robot or a group of an edge that runs here."""

    name = "robot"

    def shell_complete(
        self,
        ctx: click.Context,
        param: click.Parameter,  # noqa: ARG002 - click's signature
        incomplete: str,
    ) -> list[CompletionItem]:
        """Return the names that begin so."""
        from fleet.cli.connect import Edges  # noqa: PLC0415 - the bus is not needed without completion

        try:
            with Edges.reach(ctx.params.get("file")) as edges:
                names = {state.name for state in edges.states()}
                names |= {group for edge in edges.edges() for group in edge.groups}
        except FleetError:
            return []
        return _beginning(names, incomplete)


class CommandName(click.ParamType):  # type: ignore[type-arg]  # likewise
    """The name of a command that the robot of the same line takes."""

    name = "command"

    def shell_complete(
        self,
        ctx: click.Context,
        param: click.Parameter,  # noqa: ARG002 - click's signature
        incomplete: str,
    ) -> list[CompletionItem]:
        """Return the names that begin so."""
        from fleet.cli.connect import Edges  # noqa: PLC0415 - likewise

        try:
            with Edges.reach(ctx.params.get("file")) as edges:
                robots = edges.named(str(ctx.params.get("robot")))
                found = edges.description(robots[0])
        except FleetError:
            return []
        return _beginning({one.name for one in found.commands}, incomplete)


ROBOT = RobotName()
COMMAND = CommandName()


def _beginning(names: Iterable[str], incomplete: str) -> list[CompletionItem]:
    """Return the names that begin with what is written already."""
    return [CompletionItem(name) for name in sorted(names) if name.startswith(incomplete)]


@click.command()
@click.argument("shell", type=click.Choice(SHELLS))
@with_output
def completion(out: Output, shell: str) -> None:
    """Print what lets SHELL complete commands, and the names of robots and their commands.

    Install it with one of:  eval "$(fleet completion bash)"  in ~/.bashrc,  eval "$(fleet completion zsh)"
    in ~/.zshrc,  fleet completion fish > ~/.config/fish/completions/fleet.fish
    """
    from fleet.cli.main import fleet  # noqa: PLC0415 - which imports this

    made = get_completion_class(shell)
    assert made is not None
    script = made(fleet, {}, "fleet", VARIABLE).source()
    out.data({"shell": shell, "script": script})
    out.lines(script.splitlines())
