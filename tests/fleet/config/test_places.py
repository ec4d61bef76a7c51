"""fleet.yaml's places: what is none is told where it stands, and so is one that no fence lets in."""

import pytest

HEAD = """\
edge: {id: yard-1}
plugins: [plugins]
"""
TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c"
SITE = "site: {origin: [47.0, 8.0, 400]}"
HERE = "origin: {latitude: 47.0, longitude: 8.0}"
FENCED = f", {HERE}, fence: {{inclusion: [[[0, 0], [9, 0], [9, 9], [0, 9]]]}}"


def fleet(places, *robots, site=SITE):
    listed = "".join(
        f"  - {{name: {name}, twin: {TWIN}{number}, adapter: toy, link: 'l{number}'{more}}}\n"
        for number, (name, more) in enumerate(robots or [("a", "")], 10)
    )
    return f"{HEAD}{site}\nrobots:\n{listed}places:\n" + "".join(f"  {place}\n" for place in places)


def test_places_are_read_with_what_they_leave_out(yard):
    loaded = yard.load(
        fleet(
            [
                "dock-1: {kind: dock, at: [2, 3.5], heading: 1.57}",
                "gate: {kind: door, polygon: [[0, 0], [2, 0], [2, 1], [0, 1]], height: [0, 3]}",
                "pad: {kind: pad, frame: geodetic, at: [47.0, 8.0, 10], radius: 1.5, capacity: 2}",
            ]
        )
    )
    dock, gate, pad = (config.place(name) for name, config in loaded.config.places.items())
    assert (dock.at, dock.capacity, dock.frame) == ((2.0, 3.5), 1, "site")
    assert gate.at == pytest.approx((1.0, 0.5, 1.5))
    assert (pad.at, pad.radius, pad.capacity) == ((47.0, 8.0, 10.0), 1.5, 2)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("{}", "places.p: where is it"),
        ("{at: [1]}", "places.p.at"),
        ("{at: [1, 2, 3, 4]}", "places.p.at"),
        ("{at: [1, 2], capacity: 0}", "places.p.capacity: must be at least 1"),
        ("{at: [1, 2], kind: dok}", "places.p.kind"),
        ("{at: [1, 2], polygon: [[3, 3], [4, 3], [4, 4]]}", "places.p.at: lies outside the polygon"),
        ("{polygon: [[0, 0], [9, 0], [9, 1], [1, 1], [1, 9], [0, 9]]}", "places.p.polygon: its middle lies"),
        ("{polygon: [[0, 0], [1, 1], [1, 0], [0, 1]]}", "places.p.polygon: the sides of a polygon"),
        ("{at: [1, 2], height: [0, 2]}", "places.p.height: is [lowest, highest] of a polygon"),
        ("{polygon: [[3, 3], [4, 3], [4, 4]], radius: 2}", "places.p.radius: the polygon says"),
        ("{frame: geodetic, at: [8.5, 190]}", "places.p.at: geodetic numbers are"),
        ("{at: [1, 2], radios: 2}", "places.p.radios: unknown key (did you mean 'radius'?)"),
    ],
)
def test_a_place_that_is_none_is_reported_where_it_stands(yard, given, expected):
    (problem,) = yard.problems(fleet([f"p: {given}"]))
    assert "fleet.yaml:7:" in problem
    assert expected in problem


@pytest.mark.parametrize(
    "place",
    [
        "p: {at: [12, 2]}",
        "p: {frame: geodetic, at: [47.01, 8.0]}",
        "p: {polygon: [[9, 9], [12, 9], [12, 12]]}",
    ],
)
def test_a_place_outside_the_fences_of_all_is_a_problem(yard, place):
    (problem,) = yard.problems(fleet([place], ("a", FENCED)))
    assert "fleet.yaml:7:" in problem
    assert "places.p: it is outside the fence of a: no robot can be sent there" in problem


def test_a_place_outside_a_fence_of_degrees_is_found_too(yard):
    fence = ", fence: {frame: geodetic, inclusion: [[[47, 8], [47.001, 8], [47.001, 8.001]]]}"
    (problem,) = yard.problems(fleet(["p: {at: [-5, 0]}"], ("a", fence)))
    assert "outside the fence of a" in problem
    assert yard.load(fleet(["p: {at: [20, 60]}"], ("a", fence))).warnings == ()


def test_a_place_in_an_exclusion_is_found_too(yard):
    fence = f", {HERE}, fence: {{exclusion: [[[0, 0], [9, 0], [9, 9]]]}}"
    (problem,) = yard.problems(fleet(["p: {at: [5, 1]}"], ("a", fence)))
    assert "outside the fence of a" in problem


def test_a_place_that_some_may_not_be_at_is_a_warning_that_names_them(yard):
    loaded = yard.load(fleet(["p: {at: [12, 2]}", "q: {at: [2, 2]}"], ("a", FENCED), ("b", f", {HERE}")))
    (warning,) = loaded.warnings
    assert "it is outside the fence of a" in str(warning)


def test_where_nobody_can_tell_nothing_is_said(yard):
    assert yard.load(fleet(["p: {at: [12, 2]}"], ("a", FENCED), site="")).warnings == ()
