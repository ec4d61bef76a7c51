"""``fleet replay``: the differences of a fleet file's robots, and what it needs."""

from pathlib import Path

import pytest

from fleet_mavlink import world_frame

RECORDING = Path(__file__).parents[2] / "data" / "recordings" / "px4_full_flight.mcap"
ROBOT = (
    "{name: %s, twin: 6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f, adapter: mavlink, failsafes: ignore, "
    'link: "udpin:127.0.0.1:24550"}'
)


@pytest.fixture
def fleet_of(place):
    """Write a fleet file with one aircraft."""

    def fleet_of(name):
        (place / "one.yaml").write_text(f"edge: {{id: yard}}\nrobots:\n  - {ROBOT % name}\n")
        return "one.yaml"

    return fleet_of


def test_what_today_s_adapters_make_of_it_is_compared(fleet, fleet_of):
    result = fleet("replay", str(RECORDING), "--through-adapters", "-f", fleet_of("kestrel"), "--json")
    (robot,) = result.json["robots"]
    assert (result.code, robot["found"], robot["compared"] > 250) == (0, [], True)


def test_a_difference_is_shown_and_is_an_exit_code_of_its_own(fleet, fleet_of, monkeypatch):
    right = world_frame.enu_rotation_from_ned
    monkeypatch.setattr(
        world_frame, "enu_rotation_from_ned", lambda roll, pitch, yaw: right(pitch, roll, yaw)
    )
    result = fleet("replay", str(RECORDING), "--through-adapters", "-f", fleet_of("kestrel"))
    assert result.code == 7
    assert "kestrel position: pose.orientation" in result.out
    assert "differences in" in result.out


def test_a_robot_that_is_not_in_it_is_reported(fleet, fleet_of):
    result = fleet("replay", str(RECORDING), "--through-adapters", "-f", fleet_of("heron"))
    assert (result.code, "heron: not compared" in result.err) == (5, True)


def test_a_robot_that_the_file_does_not_have_is_refused(fleet, fleet_of):
    file = fleet_of("kestrel")
    result = fleet("replay", str(RECORDING), "--through-adapters", "-f", file, "--robot", "rex")
    assert (result.code, "has no robot 'rex'" in result.err) == (5, True)


def test_adapters_need_the_fleet_file(fleet, place):
    result = fleet("replay", str(RECORDING), "--through-adapters")
    assert (result.code, "-f fleet.yaml" in result.err) == (2, True)


def test_it_is_played_and_the_way_to_look_at_it_is_said(fleet, runtime, place):
    result = fleet("replay", str(RECORDING), "--speed", "1000", "--for", "5s")
    assert (result.code, f"FLEET_RUNTIME_DIR={runtime}/replay fleet ps" in result.err) == (0, True)


def test_without_the_extra_it_says_what_to_install(fleet, monkeypatch, place):
    monkeypatch.setattr("fleet.cli.replay.is_installed", lambda: False)
    assert "zenoh-fleet[record]" in fleet("replay", str(RECORDING)).err
