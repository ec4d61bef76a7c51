"""The process of a rehearsal, as the edge starts it."""

import subprocess
import sys

import msgspec
import pytest

from fleet.host.edge.rehearsal_task import RehearsalLine

COMMAND = (sys.executable, "-P", "-m", "fleet.rehearsal")
MISSION = {"roles": {"eye": {"kind": "mavlink"}}, "steps": [{"id": "up", "do": {"eye": "takeoff"}}]}


@pytest.fixture
def process():
    with subprocess.Popen(COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        yield process
        process.kill()


def lines_of(process):
    return [msgspec.json.decode(line, type=RehearsalLine) for line in process.stdout]


def test_it_reads_a_task_and_tells_the_result_last(field, process):
    task = field().task(MISSION, {"eye": ["drone-1"]})
    process.stdin.write(msgspec.json.encode(task) + b"\n")
    process.stdin.flush()
    *_, last = lines_of(process)
    here = msgspec.structs.replace(field().result(MISSION, {"eye": ["drone-1"]}), took=0.0)
    assert msgspec.structs.replace(last.result, took=0.0) == here, "the same in every process"
    assert process.wait(60) == 0


def test_it_ends_when_nobody_waits_for_it(field, process):
    long = {**MISSION, "steps": [{"id": "rest", "wait": "12 h"}]}
    process.stdin.write(msgspec.json.encode(field().task(long, {"eye": ["drone-1"]})) + b"\n")
    process.stdin.close()
    assert process.wait(60) == 1


def test_a_task_that_cannot_be_read_is_reported(process):
    process.stdin.write(b"{}\n")
    process.stdin.flush()
    (line,) = lines_of(process)
    assert "the task cannot be read" in line.failure
