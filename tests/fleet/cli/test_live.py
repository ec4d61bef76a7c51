"""The live view of an edge: a line for each change where there is no terminal, else a table that fits."""

import asyncio
import io
import json
import sys
from types import SimpleNamespace

import msgspec
import pytest
from rich.console import Console

from fleet.cli import live
from fleet.cli.live import PAUSE, REFRESH, show
from fleet.model.state import EdgeState, RobotState
from fleet.testing.clock import JumpingLoop

REX = RobotState("rex", "t", "toy", "yard", 1.0, health="ok", mode="GUIDED", battery=81.0)


class Robot:
    def __init__(self, state):
        self.now = state
        self.looks = 0

    def change(self, **fields):
        self.now = msgspec.structs.replace(self.now, **fields)

    def state(self):
        self.looks += 1
        return self.now


class Edge:
    def __init__(self, *states):
        self.made = [Robot(state) for state in states]

    def robots(self):
        return self.made

    def states(self):
        return [robot.now for robot in self.made]

    def state(self):
        return EdgeState("yard", "1.0", 1.0, 5.0)


def watched(work, edge, *, as_json=False):
    """Run ``work(edge)`` while the edge is shown, in time that jumps."""

    async def whole():
        task = asyncio.create_task(show(edge, SimpleNamespace(as_json=as_json)))
        await work(edge)
        await asyncio.sleep(2 * REFRESH)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        assert task.cancelled()

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        runner.run(whole())


async def nothing(_edge):
    await asyncio.sleep(10 * REFRESH)


def lines(capsys):
    return capsys.readouterr().out.splitlines()


def test_a_robot_that_stays_as_it_is_is_one_line(capsys):
    watched(nothing, Edge(REX))
    assert lines(capsys) == ["rex: ok, GUIDED, 81 %"]


TOLD = [
    ({"health": "offline"}, "rex: offline, GUIDED, 81 %"),
    ({"cause": "unplugged"}, "rex: ok, GUIDED, 81 %, unplugged"),
    ({"mode": "AUTO"}, "rex: ok, AUTO, 81 %"),
    ({"activity": "commanded"}, "rex: ok, GUIDED, 81 %, commanded"),
    ({"last_outcome": "done"}, "rex: ok, GUIDED, 81 %"),
    ({"separation": "its place is not known"}, "rex: ok, GUIDED, 81 %, separation its place is not known"),
]


@pytest.mark.parametrize(("change", "line"), TOLD)
def test_a_change_that_matters_is_a_line(capsys, change, line):
    async def work(edge):
        await asyncio.sleep(REFRESH / 2)
        edge.made[0].change(**change)

    watched(work, Edge(REX))
    assert lines(capsys) == ["rex: ok, GUIDED, 81 %", line]


def test_a_figure_that_always_changes_is_no_line(capsys):
    async def work(edge):
        for step in range(5):
            edge.made[0].change(battery=80.0 - step, stamp=2.0 + step, age=0.1 * step)
            await asyncio.sleep(REFRESH)

    watched(work, Edge(REX))
    assert len(lines(capsys)) == 1


def test_each_robot_is_compared_with_itself(capsys):
    watched(nothing, Edge(REX, msgspec.structs.replace(REX, name="max", mode="AUTO")))
    assert lines(capsys) == ["rex: ok, GUIDED, 81 %", "max: ok, AUTO, 81 %"]


def test_for_programs_a_line_is_the_whole_state(capsys):
    watched(nothing, Edge(REX), as_json=True)
    (line,) = lines(capsys)
    assert msgspec.json.decode(line, type=RobotState) == REX
    assert json.loads(line)["battery"] == 81.0


def test_text_of_a_robot_cannot_write_on_the_terminal(capsys):
    watched(nothing, Edge(msgspec.structs.replace(REX, cause="\x1b[2Jgone")))
    assert "\x1b" not in lines(capsys)[0]


@pytest.mark.parametrize("error", [BrokenPipeError(), OSError(28, "No space left on device")])
def test_an_edge_runs_on_when_nobody_reads_its_lines(monkeypatch, error):
    class Broken(io.StringIO):
        def write(self, _text):
            raise error

    monkeypatch.setattr(sys, "stdout", Broken())
    edge = Edge(REX)
    watched(nothing, edge)
    assert edge.made[0].looks > 5


def test_a_large_fleet_is_looked_at_in_parts(capsys):
    async def work(edge):
        await asyncio.sleep(PAUSE / 2)
        assert [robot.looks for robot in edge.made] == [1] * live.AT_ONCE + [0] * live.AT_ONCE
        await asyncio.sleep(PAUSE)
        assert [robot.looks for robot in edge.made] == [1] * 2 * live.AT_ONCE

    watched(work, Edge(*(msgspec.structs.replace(REX, name=f"r{each}") for each in range(2 * live.AT_ONCE))))


class Terminal(io.StringIO):
    def isatty(self):
        return True


def on_terminal(monkeypatch):
    """Let stdout be a terminal from now on, and return it."""
    monkeypatch.setattr(sys, "stdout", screen := Terminal())
    for name, value in {"COLUMNS": "60", "LINES": "10", "TERM": "xterm-256color"}.items():
        monkeypatch.setenv(name, value)
    return screen


def test_on_a_terminal_the_table_is_drawn_again(monkeypatch):
    terminal = on_terminal(monkeypatch)

    async def work(edge):
        await asyncio.sleep(REFRESH / 2)
        edge.made[0].change(mode="LAND")

    watched(work, Edge(REX))
    text = terminal.getvalue()
    assert "GUIDED" in text.partition("LAND")[0]
    assert "LAND" in text


def test_for_programs_there_is_no_table_even_on_a_terminal(monkeypatch):
    terminal = on_terminal(monkeypatch)
    watched(nothing, Edge(REX), as_json=True)
    assert len(terminal.getvalue().splitlines()) == 1


def test_the_table_fits_and_has_the_colours_of_whole_words():
    robots = [msgspec.structs.replace(REX, name=f"ok-{each}", cause="x" * 200) for each in range(50)]
    console = Console(file=io.StringIO(), width=60, height=10, force_terminal=True)
    text = live._drawn(Edge(*robots), console)
    assert len(text.plain.splitlines()) <= 10
    assert all(len(line) <= 60 for line in text.plain.splitlines())
    marked = {text.plain[span.start : span.end] for span in text.spans}
    assert marked == {"ok"}
    assert not any(text.plain[span.end :].startswith("-") for span in text.spans), "a name is no health"
