"""Robots are added to a running edge and taken out of it; the others never notice."""

import asyncio
import json
import uuid
from operator import attrgetter

import pytest

from fleet.bus import keys
from fleet.host.edge import membership
from fleet.host.process.robot_process import RobotProcess
from fleet.host.process.stop_service import names_in, stop_everywhere
from fleet.host.requests.stop_cause import local_cause
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.missions.program import Act
from fleet.model.change import ChangeKind, Outcome
from fleet.model.command import Origin, Transport
from tests.fleet.host import conftest
from tests.fleet.host.edge.test_changes import GOTO, HERE, MISSION, Field, moves, running

STOP_REX = b'["rex"]'


class Yard(Field):
    """A field whose robots come and go."""

    @property
    def robots(self):
        return json.loads(self.place.file.read_text())["robots"]

    def put(self, robots, **parts):
        self.place.change(robots=robots, **parts)

    def add(self, name, **fields):
        entry = {
            "name": name,
            "twin": str(uuid.uuid4()),
            "adapter": "toy",
            "journal": str(self.place.journal),
        }
        self.put([*self.robots, entry | HERE | fields])

    def remove(self, name):
        self.put([robot for robot in self.robots if robot["name"] != name])

    def rename(self, name, to):
        self.put([robot | ({"name": to} if robot["name"] == name else {}) for robot in self.robots])

    async def stop(self, names=b""):
        self.bus_session.put(keys.stop(self.place.id), names, urgent=True)

    def names(self):
        return [state.name for state in self.edge.states()]


@pytest.fixture
async def yard_of_two(yard, run_edge, requests):
    async with running(yard, run_edge, requests, rex=HERE, max=HERE) as there:
        yield Yard(there.place, there.edge, there.bus_session, requests)


async def test_a_robot_is_added_and_obeys(yard_of_two):
    field = yard_of_two
    field.add("ada")
    (planned,) = [change for change in (await field.request()).changes if change.name == "ada"]
    assert (planned.kind, planned.why) == (ChangeKind.ADDED, "")
    done = await field.apply()
    assert (done["ada"].kind, done["ada"].outcome) == (ChangeKind.ADDED, Outcome.DONE)
    await field.until(lambda: field.state("ada").health == "ok")
    assert (await field.say("ada", {"command": "walk"})).ok
    assert [field.place.words(name) for name in ("rex", "max")] == [["run"], ["run"]]
    assert (await field.request()).same
    tokens = await asyncio.to_thread(field.bus_session.tokens, keys.robot(field.place.id, "*"), timeout=10)
    assert keys.robot(field.place.id, "ada") in tokens


async def test_a_robot_that_cannot_be_built_leaves_nothing_behind(yard_of_two, monkeypatch):
    field = yard_of_two
    made = RobotProcess._make

    def fails(process, spec, journal=None):
        if spec.config.name == "ada":
            raise RuntimeError("no such arm")
        return made(process, spec, journal)

    field.add("ada")
    field.add("eva")
    with monkeypatch.context() as patch:
        patch.setattr(RobotProcess, "_make", fails)
        done = await field.apply()
    assert (done["ada"].outcome, "no such arm" in done["ada"].why) == (Outcome.FAILED, True)
    assert done["eva"].outcome is Outcome.DONE
    assert sorted(field.names()) == ["eva", "max", "rex"]
    assert (await field.apply())["ada"].outcome is Outcome.DONE


async def test_a_robot_that_fails_half_way_is_taken_back_everywhere(yard_of_two, monkeypatch):
    field = yard_of_two

    def fails(_process, _robot):
        raise RuntimeError("no room on the bus")

    field.add("ada")
    with monkeypatch.context() as patch:
        patch.setattr(RobotProcess, "serve", fails)
        done = (await field.apply())["ada"]
    assert (done.outcome, "no room on the bus" in done.why) == (Outcome.FAILED, True)
    assert sorted(field.names()) == ["max", "rex"]
    assert "ada" not in field.edge.missions.runs.robots
    assert (await field.apply())["ada"].outcome is Outcome.DONE
    await field.until(lambda: field.state("ada").health == "ok")


async def test_a_robot_is_taken_out_and_nothing_of_it_is_left(yard_of_two):
    field = yard_of_two
    twin = field.edge.process.robots["max"].twin
    field.remove("max")
    done = (await field.apply())["max"]
    assert (done.kind, done.outcome) == (ChangeKind.REMOVED, Outcome.DONE)
    assert field.names() == ["rex"]
    assert field.place.words("rex") == ["run"]
    assert "max" not in field.edge.missions.runs.robots
    request = field.bus_session.tokens
    assert await asyncio.to_thread(request, keys.robot(field.place.id, "*"), timeout=10) == [
        keys.robot(field.place.id, "rex")
    ]
    assert await asyncio.to_thread(request, keys.claims(twin), timeout=10) == []
    assert (await field.request()).same


@pytest.mark.parametrize(
    "part", ["missions.leave", "process.holders.give_up", "_notifier.leave", "cloud_claims.leave"]
)
async def test_a_part_that_does_not_let_go_of_a_robot_keeps_no_other_from_it(
    yard_of_two, monkeypatch, caplog, part
):
    """The robot is not run any more: half of it must not stay."""
    field = yard_of_two
    before = field.robots
    name, _, method = part.rpartition(".")

    def fails(*_):
        raise RuntimeError("no room")

    field.remove("rex")
    with monkeypatch.context() as patch:
        patch.setattr(attrgetter(name)(field.edge), method, fails)
        assert (await field.apply())["rex"].outcome is Outcome.DONE
    assert "a part of rex is left behind" in caplog.text
    assert field.names() == ["max"]
    assert "rex" not in field.edge._stop_inputs._here
    field.put(before)
    assert (await field.apply())["rex"].outcome is Outcome.DONE
    await field.until(lambda: field.state("rex").health == "ok")


async def test_a_robot_that_moves_is_not_taken_out_unless_forced_and_is_halted_first(yard_of_two):
    field = yard_of_two
    await moves(field)
    field.remove("rex")
    (planned,) = [change for change in (await field.request()).changes if change.name == "rex"]
    assert "rex is commanded" in planned.why
    assert (await field.apply())["rex"].outcome is Outcome.REFUSED
    assert field.place.words("rex") == ["run", "navigate"]
    assert (await field.apply(force=True))["rex"].outcome is Outcome.DONE
    assert {"halt", "stop"} <= set(field.place.words("rex")[2:])
    assert field.names() == ["max"]


async def test_a_robot_in_a_run_is_taken_out_of_the_run_first_when_forced(yard_of_two):
    field = yard_of_two
    field.place.change(missions={"go": MISSION | {"steps": MISSION["steps"][1:]}})
    await field.apply()
    run = await asyncio.to_thread(_start, field.place)
    field.remove("rex")
    field.place.change(missions={})
    done = await field.apply()
    assert (done["rex"].outcome, run in done["rex"].why) == (Outcome.REFUSED, True)
    assert done["missions"].outcome is Outcome.REFUSED, "it names a robot that is still there"
    done = await field.apply(force=True)
    assert done["rex"].outcome is Outcome.DONE
    await field.until(lambda: not field.edge.missions.runs.all())


def _start(place):
    from fleet.client import Fleet  # noqa: PLC0415 - by this one alone

    with Fleet(place.file) as fleet:
        return fleet.start("go").id


async def test_a_robot_with_a_new_name_waits_for_the_next_start_and_so_do_groups_that_name_it(yard_of_two):
    field = yard_of_two
    field.place.change(groups={"crew": ["rex", "max"]})
    await field.apply()
    field.rename("rex", "ada")
    field.add("eva")
    field.place.change(groups={"crew": ["ada", "max"]})
    done = await field.apply()
    assert (done["ada"].kind, done["ada"].outcome) == (ChangeKind.RESTART, Outcome.REFUSED)
    assert done["ada"].fields == ("name: rex -> ada",)
    assert done["eva"].outcome is Outcome.DONE
    assert (done["groups"].outcome, "ada, rex" in done["groups"].why) == (Outcome.REFUSED, True)
    assert sorted(field.names()) == ["eva", "max", "rex"]
    assert field.place.words("rex") == ["run"]
    await field.stop(b'["crew"]')
    await field.until(lambda: field.state("rex").emergency_stop)


async def test_nobody_may_start_a_mission_with_a_robot_that_is_not_known_or_does_not_accept_it(
    yard_of_two, monkeypatch
):
    """It is asked while the robot is shown, before the change has ended."""
    field, serve = yard_of_two, RobotProcess.serve
    missions, refusals = field.edge.missions, {}
    asker = Origin(Transport.CLOUD, "edge")

    def requested_meanwhile(process, robot):
        for name in ("ada", "nobody"):
            refusals[name] = missions._refusal(name, asker, True, True)
        refusals["follow"] = missions._routes.blocker("rex", Act("follow", "ada"))
        return serve(process, robot)

    monkeypatch.setattr(RobotProcess, "serve", requested_meanwhile)
    field.add("ada", accepts={"command": [], "navigate": []})
    assert (await field.apply())["ada"].outcome is Outcome.DONE
    assert refusals["ada"]
    assert refusals["nobody"] == "nobody is no robot of this edge"
    assert refusals["follow"] == ""
    field.remove("ada")
    assert (await field.apply())["ada"].outcome is Outcome.DONE
    assert "ada" not in missions._policies
    assert missions._refusal("ada", asker, True, True)


async def test_a_stop_survives_that_a_robot_is_taken_out_and_added_again(yard_of_two):
    field = yard_of_two
    before = field.robots
    await field.stop(STOP_REX)
    await field.until(lambda: field.state("rex").emergency_stop)
    field.remove("rex")
    assert (await field.apply())["rex"].outcome is Outcome.DONE
    field.put(before)
    assert (await field.apply())["rex"].outcome is Outcome.DONE
    assert field.state("rex").emergency_stop
    assert "emergency stop is set" in (await field.say("rex", {"command": "walk"})).reason


@pytest.mark.parametrize("place", [{}, {"worker": "limbs"}])
async def test_a_stop_survives_that_a_robot_comes_back_under_another_name(yard_of_two, place):
    field = yard_of_two
    (twin,) = (robot["twin"] for robot in field.robots if robot["name"] == "rex")
    await field.stop(STOP_REX)
    await field.until(lambda: field.state("rex").emergency_stop)
    field.remove("rex")
    await field.apply()
    field.add("ada", twin=twin, **place)
    await field.apply()
    await field.until(lambda: field.state("ada").emergency_stop)


@pytest.mark.parametrize("names", [(), ("ada",), ("all-of-them",)])
async def test_a_stop_while_a_robot_is_built_reaches_it(yard_of_two, monkeypatch, names):
    field = yard_of_two
    spec_of = membership._spec_of

    def stopped_meanwhile(loaded, name):
        field.edge.process.stop_robots(names, local_cause("", "test"))
        return spec_of(loaded, name)

    monkeypatch.setattr(membership, "_spec_of", stopped_meanwhile)
    field.add("ada")
    field.place.change(groups={"all-of-them": ["rex", "ada"]})
    assert (await field.apply())["ada"].outcome is Outcome.DONE
    assert field.state("ada").emergency_stop


@pytest.mark.parametrize("place", [{}, {"worker": "limbs"}])
async def test_a_stop_of_a_group_reaches_the_robots_that_a_change_has_added_to_it(
    yard_of_two, monkeypatch, place
):
    """The groups themselves are taken over last, since they name the robots."""
    field, spec_of = yard_of_two, membership._spec_of
    field.place.change(groups={"crew": ["rex"]})
    await field.apply()
    field.add("ada", **place)
    field.add("eva")
    field.place.change(groups={"crew": ["max", "ada", "eva"]})

    def stopped_meanwhile(loaded, name):
        if name == "eva":
            stop_everywhere(
                field.edge.process,
                field.edge.remote.values(),
                names_in(b'["crew"]', field.edge._groups),
                local_cause("", "test"),
            )
        return spec_of(loaded, name)

    monkeypatch.setattr(membership, "_spec_of", stopped_meanwhile)
    done = await field.apply()
    assert {name: done[name].outcome for name in ("ada", "eva", "groups")} == dict.fromkeys(
        ("ada", "eva", "groups"), Outcome.DONE
    )
    for name in ("rex", "max", "ada", "eva"):
        await field.until(lambda name=name: field.state(name).emergency_stop)
    assert field.edge._groups == {"crew": ["max", "ada", "eva"]}


async def test_the_groups_of_a_robot_whose_worker_reports_late_are_taken_over(yard_of_two, monkeypatch):
    """Its worker runs, but has not reported a state yet: it must not count as silent."""
    field, ignored = yard_of_two, []
    arrived = RemoteRobot.state_arrived

    def arrives_late(robot, payload):
        ignored.append(payload)
        if len(ignored) > 2:
            arrived(robot, payload)

    monkeypatch.setattr(RemoteRobot, "state_arrived", arrives_late)
    field.add("ada", worker="limbs")
    field.place.change(groups={"crew": ["max", "ada"]})
    done = await field.apply()
    assert (done["ada"].outcome, done["groups"].outcome, done["groups"].why) == (
        Outcome.DONE,
        Outcome.DONE,
        "",
    )
    assert field.edge._groups == {"crew": ["max", "ada"]}


async def test_a_stop_of_a_group_that_cannot_be_taken_over_reaches_its_old_and_its_new_robots(
    yard_of_two, monkeypatch
):
    field = yard_of_two
    field.place.change(groups={"crew": ["rex"]})
    await field.apply()
    made = RobotProcess._make

    def fails(process, spec, journal=None):
        if spec.config.name == "eva":
            raise RuntimeError("no such arm")
        return made(process, spec, journal)

    monkeypatch.setattr(RobotProcess, "_make", fails)
    field.add("ada")
    field.add("eva")
    field.place.change(groups={"crew": ["ada", "eva"]})
    done = await field.apply()
    assert (done["ada"].outcome, done["groups"].outcome) == (Outcome.DONE, Outcome.REFUSED)
    assert field.edge._groups == {"crew": ["rex", "ada", "eva"]}
    field.remove("eva")
    field.place.change(groups={"crew": ["rex"]})
    await field.apply()
    assert field.edge._groups == {"crew": ["rex"]}


async def test_a_stop_while_a_robot_is_taken_out_is_set_when_it_is_back(yard_of_two, monkeypatch):
    field = yard_of_two
    before, ended = field.robots, membership.end_run

    async def stopped_meanwhile(process, robot):
        trouble = await ended(process, robot)
        process.stop_robots((), local_cause("", "test"))
        return trouble

    field.remove("rex")
    with monkeypatch.context() as patch:
        patch.setattr(membership, "end_run", stopped_meanwhile)
        assert (await field.apply())["rex"].outcome is Outcome.DONE
    assert field.state("max").emergency_stop
    field.put(before)
    assert (await field.apply())["rex"].outcome is Outcome.DONE
    assert field.state("rex").emergency_stop


async def test_a_robot_that_is_driven_goes_on_while_others_come_and_go(yard_of_two):
    field = yard_of_two
    await moves(field, "max")
    field.remove("rex")
    field.add("ada")
    field.add("eva")
    assert {change.outcome for change in (await field.apply()).values() if change.name != "max"} == {
        Outcome.DONE
    }
    assert field.place.words("max") == ["run", "navigate"]
    assert field.edge.process.robots["max"].controller.in_motion
    assert (await field.say("max", GOTO | {"action_id": "a2"}, "navigate")).ok


async def test_a_robot_whose_adapter_does_not_end_is_not_run_a_second_time(yard_of_two, monkeypatch):
    field = yard_of_two
    robot = field.edge.process.robots["rex"]

    async def not_ended(process, robot):
        trouble = await ended(process, robot)
        assert not trouble
        robot.runner.leftover = robot.runner
        return "its adapter does not end"

    ended = membership.end_run
    monkeypatch.setattr(membership, "end_run", not_ended)
    field.remove("rex")
    done = (await field.apply())["rex"]
    assert (done.outcome, "does not end" in done.why) == (Outcome.FAILED, True)
    robot.runner.leftover = None
    assert "rex" not in field.edge.process.runs.tasks
    assert field.place.words("rex") == ["run"]


async def test_a_robot_that_may_still_move_after_its_stop_is_not_forgotten(
    yard, run_edge, requests, monkeypatch
):
    toy = conftest.TOY.replace(
        '        self.note("stop")\n',
        """        self.note("stop")
        raise fleet.TimedOut("it still moves at 3.0 m/s")
""",
        1,
    )
    monkeypatch.setattr(conftest, "TOY", toy)
    async with running(yard, run_edge, requests, rex=HERE, max=HERE) as there:
        field = Yard(there.place, there.edge, there.bus_session, requests)
        await moves(field, "rex")
        field.remove("rex")
        done = (await field.apply(force=True))["rex"]
        assert (done.outcome, "may still move" in done.why) == (Outcome.FAILED, True)
        assert sorted(field.names()) == ["max", "rex"]
        await field.until(lambda: field.place.words("rex").count("run") == 2)
