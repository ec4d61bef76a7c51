"""What a process knows of where the robots of its edge are."""

import asyncio
import json
import uuid

import pytest

from fleet.bus import keys
from fleet.host.requests.event_reporter import EventReporter
from fleet.host.robot.robot_positions import RobotPositions
from fleet.host.robot.separation_keeper import SeparationKeeper
from fleet.model.command import ReplyStatus
from fleet.model.geodesy import GeoOrigin, geo_from_world
from fleet.model.geometry import ZERO_VELOCITY, Pose, Vector3
from fleet.robot_config import MAIN, AdapterConfig, Limits, Separation
from fleet.testing.clock import ManualClock

SITE = GeoOrigin(47.397742, 8.545594, 488.0)
NAMES = ("rex", "ugv", "drone")


class Still:
    """What moves a robot that nothing moves."""

    in_motion = False

    def current_task(self):
        return None


def joined(traffic, clock, name, start=None):
    """Return a robot of this process."""
    apart = SeparationKeeper(
        AdapterConfig(name=name, twin=uuid.uuid4(), start=start),
        Separation(radius=1.0, braking=1.0, precedence=2),
        Limits(speed=1.0),
        clock=clock,
        others=traffic,
        mover=Still(),
        led=True,
        held=lambda: ZERO_VELOCITY,
        points=lambda _task: (),
        event_reporter=EventReporter(name, lambda _report: None, clock, in_motion=lambda: False),
    )
    traffic.join(apart)
    return apart


@pytest.fixture
def clock():
    return ManualClock()


def test_what_one_process_tells_another_knows_in_its_own_frame(clock):
    here, there = RobotPositions(None, NAMES, clock), RobotPositions(None, NAMES, clock)
    mine, theirs = joined(here, clock, "rex"), joined(there, clock, "drone")
    mine.set_world_origin(SITE)
    theirs.set_world_origin(_beside(SITE, 30.0, 40.0))
    mine.observe(Pose())
    theirs.observe(Pose(Vector3(0.0, 0.0, 7.0)))
    here.receive(there.positions_message(), "")
    (other,) = here.others("rex")
    assert (other.name, other.at.x, other.at.y, other.at.z) == (
        "drone",
        pytest.approx(30.0, abs=0.01),
        pytest.approx(40.0, abs=0.01),
        pytest.approx(7.0, abs=0.01),
    )


def _beside(origin, east, north):
    point = geo_from_world(origin, Vector3(east, north))
    return GeoOrigin(point.latitude, point.longitude, point.altitude)


def test_a_process_that_falls_silent_leaves_its_robots_where_they_were_and_older(clock):
    here, there = RobotPositions(SITE, NAMES, clock), RobotPositions(SITE, NAMES, clock)
    joined(here, clock, "rex", (0.0, 0.0, 0.0)).observe(Pose())
    joined(there, clock, "ugv", (3.0, 0.0, 0.0)).observe(Pose())
    here.receive(there.positions_message(), "")
    clock.advance(60.0)
    (other,) = here.others("rex")
    assert (other.at.x, other.age) == (3.0, 60.0)
    here.receive(
        RobotPositions(SITE, NAMES, clock).positions_message(), ""
    )  # it was started anew and knows nothing yet
    assert [robot.name for robot in here.others("rex")] == ["ugv"]


def test_without_a_site_robots_on_earth_and_on_the_ground_are_unknown_to_each_other(clock):
    for site, unknown in ((None, "unknown to drone"), (SITE, "")):
        traffic = RobotPositions(site, ("ugv", "drone"), clock)
        joined(traffic, clock, "ugv", (1.0, 0.0, 0.0)).observe(Pose())
        drone = joined(traffic, clock, "drone")
        drone.set_world_origin(SITE)
        drone.observe(Pose())
        assert traffic.unknown("ugv") == unknown
        assert len(traffic.others("ugv")) == (0 if unknown else 1)


def test_why_nobody_knows_how_far_a_robot_is_from_others_is_said(clock):
    traffic = RobotPositions(SITE, ("rex", "ugv"), clock)
    rex = joined(traffic, clock, "rex")
    ugv = joined(traffic, clock, "ugv", (1.0, 0.0, 0.0))
    assert traffic.unknown("rex") == "unknown: it is not placed"
    rex.set_world_origin(SITE)
    assert traffic.unknown("rex") == "unknown: it has not reported its position"
    rex.observe(Pose())
    assert traffic.unknown("rex") == "unknown to ugv"
    ugv.observe(Pose())
    assert traffic.unknown("rex") == ""


def test_of_many_robots_that_are_unknown_the_first_are_named(clock):
    names = [f"ugv-{number}" for number in range(1, 11)]
    traffic = RobotPositions(SITE, ("rex", *names), clock)
    joined(traffic, clock, "rex", (0.0, 0.0, 0.0)).observe(Pose())
    assert traffic.unknown("rex") == f"unknown to {', '.join(names[:8])} and 2 more"


def test_what_is_known_follows_every_change_at_once(clock):
    traffic, there = (RobotPositions(SITE, NAMES, clock) for _ in range(2))
    rex, ugv = (joined(traffic, clock, name, (1.0, 0.0, 0.0)) for name in ("rex", "ugv"))
    rex.observe(Pose())
    drone = joined(there, clock, "drone", (9.0, 0.0, 0.0))
    said = [traffic.unknown("rex")]
    for change in (
        lambda: ugv.observe(Pose()),
        lambda: (drone.observe(Pose()), traffic.receive(there.positions_message(), "")),
        lambda: (drone.observe(Pose(Vector3(40.0))), traffic.receive(there.positions_message(), "")),
        lambda: ugv.lose_placement("it was carried away"),
        lambda: traffic.leave("ugv"),
        lambda: (there.leave("drone"), traffic.receive(there.positions_message(), "", process=MAIN)),
        lambda: traffic.expect("dog"),
    ):
        change()
        said.append(traffic.unknown("rex"))
    assert [each.removeprefix("unknown to ") for each in said] == [
        "ugv, drone", "drone", "", "drone", "ugv, drone", "drone", "", "dog"
    ]  # fmt: skip


def test_the_reasons_of_many_robots_take_one_look_at_each(clock):
    class Counted:
        on_earth, lost, placement = True, "", object()
        looks = 0

        def __init__(self, name):
            self.name = name

        @property
        def at(self):
            Counted.looks += 1
            return Vector3()

    names = [f"drone-{number}" for number in range(300)]
    traffic = RobotPositions(None, names, clock)
    for name in names:
        traffic.join(Counted(name))
    assert {traffic.unknown(name) for name in names} == {""}
    assert Counted.looks <= 3 * len(names)


def test_a_robot_that_is_alone_on_its_edge_is_unknown_to_nobody(clock):
    traffic = RobotPositions(SITE, ("rex",), clock)
    joined(traffic, clock, "rex")
    assert traffic.unknown("rex") == ""


@pytest.mark.parametrize("payload", [b"", b"{", b'{"robots": [{"robot": {"name": 5}}]}', b'{"robots": 7}'])
def test_what_cannot_be_read_is_reported_and_changes_nothing(clock, caplog, payload):
    traffic = RobotPositions(SITE, NAMES, clock)
    joined(traffic, clock, "rex", (0.0, 0.0, 0.0)).observe(Pose())
    traffic.receive(payload, "")
    assert traffic.others("rex") == []
    assert "cannot be read" in caplog.text


def test_nobody_else_can_tell_where_a_robot_of_this_process_is(clock):
    traffic, liar = RobotPositions(SITE, NAMES, clock), RobotPositions(SITE, NAMES, clock)
    joined(traffic, clock, "rex", (0.0, 0.0, 0.0)).observe(Pose())
    joined(liar, clock, "rex", (50.0, 0.0, 0.0)).observe(Pose())
    traffic.receive(liar.positions_message(), "")
    assert traffic.one("rex").at == Vector3()


def two_edges(clock, yard_site, barn_site):
    """Return the positions that two partner edges know, each with one robot of its own."""
    yard = RobotPositions(yard_site, ("rex",), clock, edge="yard", partners={"ugv": "barn"})
    barn = RobotPositions(barn_site, ("ugv",), clock, edge="barn", partners={"rex": "yard"})
    return yard, barn


def test_a_partner_s_robot_is_known_in_the_frame_of_the_own_site(clock):
    yard, barn = two_edges(clock, SITE, _beside(SITE, 30.0, 40.0))
    joined(yard, clock, "rex", (0.0, 0.0, 0.0)).observe(Pose())
    joined(barn, clock, "ugv", (1.0, 2.0, 0.0)).observe(Pose())
    assert yard.unknown("rex") == "unknown to ugv"
    yard.receive(barn.positions_message(), "barn")
    (other,) = yard.others("rex")
    assert (other.at.x, other.at.y) == (pytest.approx(31.0, abs=0.01), pytest.approx(42.0, abs=0.01))
    assert not yard.alone
    assert yard.unknown("rex") == ""


def test_a_partner_s_robot_on_earth_is_known_without_any_site(clock):
    yard, barn = two_edges(clock, None, None)
    mine, theirs = joined(yard, clock, "rex"), joined(barn, clock, "ugv")
    mine.set_world_origin(SITE)
    theirs.set_world_origin(_beside(SITE, 3.0, 4.0))
    mine.observe(Pose())
    theirs.observe(Pose())
    yard.receive(barn.positions_message(), "barn")
    (other,) = yard.others("rex")
    assert (other.at.x, other.at.y) == (pytest.approx(3.0, abs=0.01), pytest.approx(4.0, abs=0.01))


@pytest.mark.parametrize(("yard_site", "barn_site"), [(SITE, None), (None, None)])
def test_a_partner_s_robot_that_only_its_edge_can_place_is_unknown(clock, yard_site, barn_site):
    yard, barn = two_edges(clock, yard_site, barn_site)
    joined(yard, clock, "rex", (0.0, 0.0, 0.0)).observe(Pose())
    joined(barn, clock, "ugv", (1.0, 2.0, 0.0)).observe(Pose())
    yard.receive(barn.positions_message(), "barn")
    assert yard.others("rex") == []
    assert yard.unknown("rex") == "unknown to ugv"


def test_an_edge_tells_only_where_its_own_robots_are(clock):
    yard, barn = two_edges(clock, SITE, SITE)
    joined(yard, clock, "rex", (0.0, 0.0, 0.0)).observe(Pose())
    joined(barn, clock, "ugv", (1.0, 2.0, 0.0)).observe(Pose())
    yard.receive(barn.positions_message(), "shed")
    assert yard.others("rex") == []


def goal(x):
    """Return a goal's message in the robot's own world."""
    return json.dumps({"command": "goto", "source_type": "tele", "position": [x, 0, 0]}).encode()


async def test_robots_in_workers_are_judged_against_each_other_too(yard, run_edge, requests):
    fleet = yard(
        rex={"stands": True, "start": [0.0, 0.0, 0.0]},
        ugv={"stands": True, "start": [6.0, 0.0, 0.0], "worker": "main"},
        dog={"stands": True, "start": [12.0, 0.0, 0.0]},
    )
    edge = fleet.edge()
    async with run_edge(edge):
        bus_session = fleet.bus_session()

        def request(robot, x):
            answers = bus_session.request(
                keys.command(fleet.id, robot), goal(x), timeout=60, parameters={"kind": "navigate"}
            )
            return [json.loads(answer) for _, answer in answers]

        def known():
            return all(state.reachable and not state.separation for state in edge.states())

        await requests.until(known, within=40.0)
        onto_ugv = await asyncio.to_thread(request, "rex", 6.0)
        first = await asyncio.to_thread(request, "dog", -3.0)
        others = edge.process.robots["ugv"].controller.guard.apart.others
        await requests.until(lambda: others.seen("ugv", "dog").route)
        meets = await asyncio.to_thread(request, "ugv", 3.0)
        bus_session.close()
    assert (onto_ugv[0]["status"], "0.0 m from ugv" in onto_ugv[0]["reason"]) == ("rejected", True)
    assert first[0]["status"] == ReplyStatus.ACCEPTED
    assert "from dog's way" in meets[0]["reason"]


def test_a_robot_that_another_process_has_no_more_is_forgotten_and_one_that_is_new_is_known(clock):
    here, there = (RobotPositions(SITE, ("rex",), clock, edge="yard") for _ in range(2))
    joined(there, clock, "ada", (3.0, 0.0, 0.0)).observe(Pose())
    sheet = there.positions_message()
    here.receive(sheet, "yard", "limbs")
    assert here.one("ada").at.x == 3.0
    there.leave("ada")
    here.receive(there.positions_message(), "yard", "legs")
    assert here.one("ada") is not None, "only who told of it, or the edge's own process, takes it back"
    here.receive(there.positions_message(), "yard", "main")
    assert here.one("ada") is None
    assert here.alone
    here.receive(sheet, "yard", "limbs")
    assert here.one("ada") is not None, "it was added again"
    here.receive(there.positions_message(), "yard", "limbs")
    assert here.one("ada") is None
