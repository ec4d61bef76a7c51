"""Which names of a fleet file its missions may use."""

import pytest

from fleet.config.known import known_of
from fleet.model.event import EventKind


def test_missions_may_name_robots_robots_of_partners_groups_and_places():
    known = known_of(
        {
            "robots": [{"name": "rex"}, {"name": "kes"}],
            "partners": {"barn": {"robots": ["max"]}, "hall": {}},
            "groups": {"yard": ["rex"]},
            "places": {"dock": [0, 0]},
        }
    )
    assert list(known.names) == ["rex", "kes", "max", "yard"]
    assert list(known.places) == ["dock"]
    assert known.missions is None


@pytest.mark.parametrize(
    ("site", "on_earth"),
    [({"origin": [1, 2, 3]}, True), ({"origin": None}, False), ({}, False), (None, False), (5, False)],
)
def test_a_site_is_on_earth_when_its_origin_is(site, on_earth):
    assert known_of({"site": site}).on_earth is on_earth


def test_the_hosts_own_events_are_known_and_those_that_are_declared():
    hosts = [kind.value for kind in EventKind]
    assert list(known_of({}).events) == hosts
    assert list(known_of({"events": ["door", 5]}).events) == [*hosts, "door", "5"]


@pytest.mark.parametrize("wrong", [None, 5, "x", [5, "x", None, []], {"a": 5}])
@pytest.mark.parametrize("section", ["robots", "partners", "groups", "places", "site"])
def test_whatever_else_is_wrong_with_a_file_the_rest_is_known(section, wrong):
    data = {"robots": [{"name": "rex"}], "groups": {"yard": ["rex"]}, section: wrong}
    known = known_of(data)
    assert ("rex" in known.names) is (section != "robots")
    assert ("yard" in known.names) is (section != "groups")


def test_partners_with_other_errors_are_left_out():
    known = known_of({"partners": {"a": 5, "b": {"robots": 5}, "c": {"robots": ["max"]}}})
    assert list(known.names) == ["max"]
