"""Recordings of real autopilots, made by a real edge, through today's adapter."""

from pathlib import Path

import pytest

from fleet.errors import Refused, StateError
from fleet.replay.file import load_recording, replay_robot
from fleet_mavlink import world_frame
from fleet_mavlink.adapter import MavlinkAdapter
from fleet_quadruped.adapter import QuadrupedAdapter
from fleet_quadruped.config import QuadrupedConfig
from fleet_quadruped.drives.cia402.drive import Cia402Drives

RECORDINGS = Path(__file__).parents[2] / "data" / "recordings"
KESTREL = {
    "name": "kestrel",
    "twin": "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f",
    "adapter": "mavlink",
    "failsafes": "ignore",
    "link": "udpin:127.0.0.1:24550",
}


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def replayed(flight, adapter=MavlinkAdapter, **changes):
    config = adapter.Config.model_validate(KESTREL | changes)
    return replay_robot(load_recording(RECORDINGS / f"{flight}.mcap"), adapter, config)


@pytest.mark.parametrize(("name", "least"), [("px4_full_flight", 250), ("ap_copter_full_flight", 150)])
def test_a_real_autopilot_is_reported_as_it_was(name, least):
    found = replayed(name)
    assert (found.found, found.is_whole, found.compared > least) == ((), True, True)


def test_an_autopilot_that_was_simulated_is_replayed_by_its_recorded_link():
    assert replayed("px4_full_flight", link="sim:px4").found == ()


def test_a_planted_error_in_the_reading_of_attitudes_is_found(monkeypatch):
    right = world_frame.enu_rotation_from_ned
    monkeypatch.setattr(
        world_frame, "enu_rotation_from_ned", lambda roll, pitch, yaw: right(pitch, roll, yaw)
    )
    assert {each.channel for each in replayed("px4_full_flight").found} == {"position"}


REX = {
    "name": "rex",
    "twin": "0b7e7a52-3c1d-4f08-8f6e-5d2a9c4b1e73",
    "adapter": "quadruped",
    "link": "sim:auto",
}


def walked():
    """Replay four seconds of a simulated dog's walk."""
    recording = load_recording(RECORDINGS / "dog_walk.mcap")
    return replay_robot(recording, QuadrupedAdapter, QuadrupedConfig.model_validate(REX))


def test_a_walk_of_a_dog_is_measured_as_it_was():
    found = walked()
    assert (found.found, found.compared > 100) == ((), True)


def test_a_planted_error_in_the_reading_of_angles_is_found(monkeypatch):
    feedback = Cia402Drives.feedback
    monkeypatch.setattr(Cia402Drives, "feedback", lambda drives, now: turned(feedback(drives, now)))
    assert {each.channel for each in walked().found} == {"joint_states"}


def turned(joints):
    """Return joints that are a thousandth of a radian off."""
    return joints._replace(angles=tuple(angle + 0.001 for angle in joints.angles))


def test_a_robot_that_is_not_in_it_is_refused_with_those_that_are():
    with pytest.raises(Refused, match="no reports of a robot 'heron'") as refused:
        replayed("px4_full_flight", name="heron")
    assert "yard/kestrel" in refused.value.hint


def test_a_file_that_is_no_recording_is_reported(tmp_path):
    (tmp_path / "x.mcap").write_bytes(b"no")
    with pytest.raises(StateError, match="is no MCAP file"):
        load_recording(tmp_path / "x.mcap")
