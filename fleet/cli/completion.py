"""Shell completion of commands, robots and their commands, and ``fleet completion`` to install it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem, get_completion_class

from fleet.cli.output import Output, with_output
from fleet.errors import FleetError

if TYPE_CHECKING:
    from fleet.client.edges import Edges

SHELLS = ("bash", "zsh", "fish")
VARIABLE = "_FLEET_COMPLETE"


class RunningName(click.ParamType):  # type: ignore[type-arg]  # generic in newer clicks alone
    """A name known by the running edges; ``names`` queries them, with the preceding parameters."""

    def __init__(self, name: str, names: Callable[[Edges, Mapping[str, object]], set[str]]) -> None:
        self.name = name
        self._names = names

    def shell_complete(
        self,
        ctx: click.Context,
        param: click.Parameter,  # noqa: ARG002 - click's signature
        incomplete: str,
    ) -> list[CompletionItem]:
        """Return the names with the typed prefix; none if no edge answers."""
        from fleet.client.edges import Edges  # noqa: PLC0415 - the bus is not needed without completion

        try:
            with Edges.reach(ctx.params.get("file")) as edges:
                names = self._names(edges, ctx.params)
        except FleetError:
            return []
        return [CompletionItem(name) for name in sorted(names) if name.startswith(incomplete)]


def _robots(edges: Edges, _given: Mapping[str, object]) -> set[str]:
    """Return the robots and groups."""
    groups = {group for edge in edges.edges() for group in edge.groups}
    return groups | {state.name for state in edges.states()}


def _commands(edges: Edges, given: Mapping[str, object]) -> set[str]:
    """Return the commands of the robot on the same line."""
    (robot, *_) = edges.named(str(given.get("robot")))
    return {one.name for one in edges.description(robot).commands}


def _places(edges: Edges, _given: Mapping[str, object]) -> set[str]:
    """Return the places."""
    return {place for edge in edges.edges() for place in edge.places}


def _schedules(edges: Edges, _given: Mapping[str, object]) -> set[str]:
    """Return the schedules."""
    return {state.name for _, state in edges.schedules()}


SCHEDULE = RunningName("schedule", _schedules)
ROBOT = RunningName("robot", _robots)
PLACE = RunningName("place", _places)
COMMAND = RunningName("command", _commands)


@click.command()
@click.argument("shell", type=click.Choice(SHELLS))
@with_output
def completion(out: Output, shell: str) -> None:
    """Print the completion of commands, robots and their commands for SHELL.

    Install it with one of:  eval "$(fleet completion bash)"  in ~/.bashrc,  eval "$(fleet completion zsh)" in
    ~/.zshrc,  fleet completion fish > ~/.config/fish/completions/fleet.fish
    """
    from fleet.cli.main import fleet  # noqa: PLC0415 - circular import

    made = get_completion_class(shell)
    assert made is not None
    script = made(fleet, {}, "fleet", VARIABLE).source()
    out.data({"shell": shell, "script": script})
    out.lines(script.splitlines())
