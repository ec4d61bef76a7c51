"""Missions of several kinds of robots, from the command line, on an edge that dies whenever it likes."""

import contextlib
import itertools
import json
import os
import random
import re
import signal
import time
import uuid

import msgspec
import psutil
import pytest

from fleet.client import mission_requests
from fleet.client.edges import Edges
from fleet.errors import FleetError
from tests.tools.waiting import wait_until

KILLS, SOAK_KILLS = 3, 200  # three: one for each policy
SEED = 7
MISSION = {
    "version": 1,
    "roles": {"eye": {"kind": "mavlink"}, "feet": {"from": "yard", "kind": "ugv"}},
    "steps": [
        {
            "id": "out",
            "do": {
                "eye": {"command": "takeoff", "with": {"altitude": 4}},
                "feet": {"goto": [1.5, -8]},
            },
            "undo": {"eye": "land"},
        },
        {"id": "home", "do": {"eye": "land", "feet": {"goto": [0, -8]}}},
    ],
    "on_failure": "undo",
    "on_restart": "fail",
}
WALK = {"do": {"dog": {"goto": [1.0, -12]}}, "id": "walk"}
WITH_A_DOG = {
    **MISSION,
    "roles": {**MISSION["roles"], "dog": {"kind": "quadruped"}},
    "steps": [
        {
            **MISSION["steps"][0],
            "do": {**MISSION["steps"][0]["do"], "dog": {"command": "stand_up"}},
            "undo": {**MISSION["steps"][0]["undo"], "dog": "sit_down"},
        },
        WALK,
        {**MISSION["steps"][1], "do": {**MISSION["steps"][1]["do"], "dog": "sit_down"}},
    ],
}
pytestmark = pytest.mark.real_time
ROBOTS = ("kestrel", "beast", "rex")
TERMINAL = {"completed", "completed_with_losses", "failed", "undone", "undo_failed", "aborted", "unknown"}


def _ready(state):
    return state["health"] == "ok" and "site" in state


@pytest.fixture(scope="module")
def yard(shared_fleet, shared_folder):
    """Run an edge with a drone, a wheeled robot and a quadruped, all simulated, for all tests of missions."""
    latitude, longitude, altitude = 47.397742, 8.545594, 488.0
    home = f"home={latitude},{longitude},{altitude:g},0"
    base = {"adapter": "ugv", "profile": "waveshare-beast", "link": "sim:waveshare-beast"}
    robots = [
        {"name": "kestrel", "adapter": "mavlink", "link": f"sim:px4?{home}"},
        {"name": "beast", **base, "start": [0, -8, 0]},
        {"name": "rex", "adapter": "quadruped", "link": "sim:kinematic", "start": [0, -12, 0]},
    ]
    policies = ("fail", "hold_and_ask", "continue")
    config = {
        "edge": {"id": f"yard-{uuid.uuid4().hex[:6]}", "spool": {"path": "state"}},
        "site": {"origin": [latitude, longitude, altitude]},
        "groups": {"yard": [robot["name"] for robot in robots]},
        "robots": [{**robot, "twin": str(uuid.uuid4())} for robot in robots],
        "missions": {
            "two": MISSION,
            **{policy: {**WITH_A_DOG, "on_restart": policy} for policy in policies},
        },
        "schedules": {"round": {"mission": "two", "every": "1 h", "enabled": False}},
    }
    (shared_folder / "fleet.yaml").write_text(json.dumps(config))
    running = shared_fleet("run", "--json", folder=shared_folder)
    for robot in robots:
        running.robot(robot["name"], "is ready", _ready)
    return running


def start(yard, mission):
    """Start a mission once its robots can; returns the run's id."""

    def started():
        called = yard.call("mission", "run", mission, "--detach", "--json")
        return json.loads(called.stdout)["run"] if called.returncode == 0 else None

    return wait_until("the mission begins", started)


@contextlib.contextmanager
def client(yard):
    """Reach the edge; None while it is away."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FLEET_RUNTIME_DIR", yard.environment["FLEET_RUNTIME_DIR"])
        try:
            reached = Edges.reach(None)
        except FleetError:
            yield None
            return
        with reached:
            yield reached


def run_of(yard, run):
    """Return what the edge says of a run; None while it does not answer."""
    with client(yard) as edges:
        runs = mission_requests.runs(edges, run) if edges else []
    return json.loads(msgspec.json.encode(runs[0])) if runs else None


def robot(yard, name):
    """Return what the edge says of a robot; nothing while it does not answer."""
    with client(yard) as edges:
        robots = edges.states() if edges else []
    found = next((each for each in robots if each.name == name), None)
    return json.loads(msgspec.json.encode(found)) if found else {"health": "offline", "run": "?"}


def is_free(yard, name):
    """Wait until a robot is well and in no run."""

    def free():
        state = robot(yard, name)
        return _ready(state) and not state.get("run")

    wait_until(f"{name} is given back", free)


def story(yard, run):
    """Return the story of a run."""
    return json.loads(yard.call("mission", "log", run, "--json").stdout)["log"]


def ended(yard, run, *, answers=False):
    """Wait for a run's end; returns it. ``answers``: say continue to whatever it asks."""

    def end():
        state = run_of(yard, run)
        if answers and state is not None and "question" in state:
            yard.call("mission", "answer", "continue", run)
        return state if state is not None and state.get("outcome") else None

    return wait_until("the run ends", end, within=110)


@pytest.mark.timeout(300)
def test_a_drone_and_a_wheeled_robot_carry_out_a_mission(yard):
    called = yard.call("mission", "run", "two", "--json")
    assert called.returncode == 0, called.stdout + called.stderr
    state = json.loads(called.stdout)
    assert state["outcome"] == "completed"
    assert {each["robot"]: each["outcome"] for each in state["robots"]} == {
        "kestrel": "done",
        "beast": "done",
    }
    is_free(yard, "kestrel")


@pytest.mark.timeout(300)
def test_a_robot_in_a_run_obeys_nobody_else_until_it_is_taken(yard):
    run = start(yard, "two")
    assert robot(yard, "beast")["run"] == run
    refused = yard.call("goto", "beast", "1", "1")
    assert refused.returncode == 5
    assert f"it is in run {run}; fleet take takes it out of the run" in refused.stdout
    taken = yard.call("take", "beast")
    assert taken.returncode == 0, taken.stdout + taken.stderr
    state = ended(yard, run)
    assert state["outcome"] == "undone"  # its role is not filled any more: the drone lands
    robots = {each["robot"]: each for each in state["robots"]}
    assert robots["beast"]["outcome"] == "taken"
    assert not [line for line in story(yard, run) if line.get("robot") == "beast" and "undo" in line["text"]]


@pytest.mark.timeout(300)
def test_an_emergency_stop_of_all_ends_the_run_and_nothing_is_undone(yard):
    run = start(yard, "two")
    wait_until("the base moves", lambda: "navigating" in robot(yard, "beast").get("activity", ""))
    yard.call("stop", "--all")  # a busy machine may not see it stand in time; the run ends all the same
    state = ended(yard, run)
    assert state["outcome"] == "aborted"
    assert {each["outcome"] for each in state["robots"]} == {"stopped"}
    assert not any("begins land" in line["text"] for line in story(yard, run))
    for name in ROBOTS:
        release = ("send", name, "release_emergency_stop")  # refused right after another sender's stop
        wait_until(f"{name} is released", lambda release=release: yard.call(*release).returncode == 0)
    yard.call("send", "kestrel", "land", "--wait")


@pytest.mark.timeout(300)
def test_a_firing_whose_edge_is_killed_has_one_run_that_ends(yard):
    called = wait_until(
        "the schedule fires", lambda: (one := yard.call("schedule", "run", "round")).returncode == 0 and one
    )
    run = called.stdout.split()[-1]
    (edge,) = psutil.Process(yard.process.pid).children()
    os.kill(edge.pid, signal.SIGKILL)
    assert ended(yard, run)["outcome"] == "failed"  # as its mission says of a restart
    runs = json.loads(yard.call("mission", "ps", "--all", "--json").stdout)["runs"]
    fired = [each for each in runs if each["by"] == "schedule round"]
    assert [(each["run"], each["way"]) for each in fired] == [(run, "mission")]
    (schedule,) = json.loads(yard.call("schedule", "ls", "--json").stdout)
    assert (schedule["last"][0]["state"], schedule["last"][0]["run"]) == ("started", run)


@pytest.mark.timeout(9000)
def test_a_run_ends_truly_whenever_the_edge_is_killed_and_begins_nothing_twice(yard, pytestconfig):
    kills = SOAK_KILLS if pytestconfig.getoption("--soak") else KILLS
    seed = random.randrange(1 << 30) if pytestconfig.getoption("--soak") else SEED
    rng = random.Random(seed)
    policies = itertools.cycle(["hold_and_ask", "continue", "fail"])
    for kill, policy in zip(range(kills), policies, strict=False):
        run = start(yard, policy)
        time.sleep(rng.uniform(0.0, 12.0))  # anywhere in it: nothing is awaited
        before = run_of(yard, run)
        (edge,) = psutil.Process(yard.process.pid).children()
        os.kill(edge.pid, signal.SIGKILL)
        state = ended(yard, run, answers=True)
        assert state["outcome"] in TERMINAL, (seed, kill, state)
        begun = [
            (line["step"], line["robot"], line["text"])
            for line in story(yard, run)
            if "begins" in line["text"]
        ]
        assert len(begun) == len(set(begun)), (seed, kill, begun)
        if before is not None and not before.get("outcome") and policy == "fail":
            assert state["outcome"] != "completed", (seed, kill, state)
        for name in ROBOTS:
            is_free(yard, name)
        assert commands_are_carried_out_once(yard, run), (seed, kill)
        yard.call("send", "kestrel", "land", "--wait")


def commands_are_carried_out_once(yard, run):
    """Return whether no command of a run was accepted twice, by the robots' own history."""
    records = json.loads(yard.call("history", "--json").stdout)
    records = records["events"] if isinstance(records, dict) else records
    accepted = [
        (each["robot"], each["request"])
        for each in records
        if run in json.dumps(each.get("asker", {}))
        and re.search(r"accepted$", each["text"])
        and each.get("request")
    ]
    return len(accepted) == len(set(accepted))
