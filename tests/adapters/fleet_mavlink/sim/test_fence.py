"""The fence in a simulated autopilot's memory: height, circle and polygons, and one breach at a time."""

from types import SimpleNamespace

import pytest

from fleet_mavlink.sim.fence import CIRCLE, HEIGHT, POLYGON, FenceBounds, FenceMonitor, polygons
from fleet_mavlink.sim.mission_items import FENCE, Item

INSIDE, OUTSIDE = 5001, 5002
ALL = HEIGHT | CIRCLE | POLYGON


class Pilot:
    """An autopilot with a fence; its degrees are metres."""

    def __init__(self, *areas, home=(0.0, 0.0, 0.0)):
        self.params, self.place = None, (0.0, 0.0, 488.0)
        self.items = [
            Item(0, command, 1, len(corners), 0, 0, 0, round(north * 1e7), round(east * 1e7), 0.0)
            for command, corners in areas
            for north, east in corners
        ]
        self.missions = SimpleNamespace(plan=lambda kind: self.items if kind == FENCE else [])
        self.frame = SimpleNamespace(ned_of=lambda north, east, altitude: (north, east, 0.0))
        self.home = SimpleNamespace(ned=lambda: home)
        self.body = SimpleNamespace(north=0.0, east=0.0, down=0.0)


def square(half, north=0.0, east=0.0):
    corners = (-half, -half), (-half, half), (half, half), (half, -half)
    return [(north + one, east + other) for one, other in corners]


def monitor(*areas, kinds=ALL, height=0.0, radius=0.0, home=(0.0, 0.0, 0.0)):
    return FenceMonitor(Pilot(*areas, home=home), lambda params: FenceBounds(kinds, height, radius))


def test_a_fence_that_is_switched_off_has_no_outside():
    off = FenceMonitor(Pilot((INSIDE, square(1.0))), lambda params: None)
    assert not off.is_outside((1e6, 1e6, -1e6))


@pytest.mark.parametrize(("down", "outside"), [(-50.0, False), (-50.1, True), (10.0, False)])
def test_a_height_is_measured_from_home(down, outside):
    assert monitor(height=50.0).is_outside((0.0, 0.0, down)) is outside
    assert monitor(height=50.0, home=(0.0, 0.0, -5.0)).is_outside((0.0, 0.0, down - 5.0)) is outside


@pytest.mark.parametrize(
    ("place", "outside"), [((30.0, 40.0), False), ((30.0, 40.1), True), ((-60.0, 0.0), True)]
)
def test_a_circle_is_around_home(place, outside):
    assert monitor(radius=50.0).is_outside((*place, 0.0)) is outside
    moved = place[0] + 7.0, place[1] - 9.0, 0.0
    assert monitor(radius=50.0, home=(7.0, -9.0, 0.0)).is_outside(moved) is outside


@pytest.mark.parametrize(
    "bounds",
    [
        {"kinds": CIRCLE | POLYGON, "height": 1.0},
        {"kinds": HEIGHT | POLYGON, "radius": 1.0},
        {"height": 0.0, "radius": 0.0},
    ],
)
def test_a_bound_that_is_not_checked_or_zero_is_none(bounds):
    assert not monitor(**bounds).is_outside((500.0, 500.0, -500.0))


def test_polygons_count_only_where_they_are_checked():
    areas = (INSIDE, square(10.0))
    assert monitor(areas).is_outside((20.0, 0.0, 0.0))
    assert not monitor(areas, kinds=HEIGHT | CIRCLE).is_outside((20.0, 0.0, 0.0))


def test_a_vehicle_is_inside_in_any_of_its_inclusions_and_in_none_of_its_exclusions():
    fence = monitor((INSIDE, square(10.0)), (INSIDE, square(10.0, east=100.0)), (OUTSIDE, square(2.0)))
    assert not fence.is_outside((5.0, 5.0, 0.0))
    assert not fence.is_outside((0.0, 100.0, 0.0))
    assert fence.is_outside((0.0, 50.0, 0.0))
    assert fence.is_outside((0.0, 0.0, 0.0))


def test_without_an_inclusion_everything_but_the_exclusions_is_inside():
    fence = monitor((OUTSIDE, square(2.0)))
    assert not fence.is_outside((500.0, 500.0, 0.0))
    assert fence.is_outside((1.0, 1.0, 0.0))


def test_polygons_are_as_many_corners_as_the_first_one_says():
    pilot = Pilot((INSIDE, square(10.0)), (OUTSIDE, square(2.0)), (INSIDE, square(1.0, east=50.0)[:3]))
    assert [len(each) for each in polygons(pilot, INSIDE)] == [4, 3]
    assert next(polygons(pilot, OUTSIDE)) == tuple(square(2.0))
    pilot.items.pop()
    assert [len(each) for each in polygons(pilot, INSIDE)] == [4], "one that is cut short is none"


def test_a_breach_is_told_once_each_time_the_fence_is_left():
    fence, breaches = monitor(radius=50.0), []
    for north in (0.0, 60.0, 70.0, 0.0, 60.0):
        fence._pilot.body.north = north
        fence.watch(lambda north=north: breaches.append(north))
    assert breaches == [60.0, 60.0]
