"""Recorded frames through today's adapters: nothing differs, until the adapter does."""

import contextlib

import msgspec
import pytest

import fleet
from fleet.errors import Refused
from fleet.replay.through import SETTLED, replay


def channels(found):
    """Return the channels on which something differs."""
    return {each.channel for each in found.found}


def test_what_a_frame_adapter_reported_is_reported_again(rover, rover_config, recorded_rover):
    found = replay(rover, rover_config, recorded_rover)
    assert (found.found, found.is_whole, found.compared >= 20) == ((), True, True)


def test_twice_the_same_comes_out(rover, rover_config, recorded_rover):
    class Wrong(rover):
        def decode(self, frame, stamp):
            return super().decode(frame.replace(b"0.1", b"0.2"), stamp)

    assert replay(Wrong, rover_config, recorded_rover) == replay(Wrong, rover_config, recorded_rover)


def test_an_adapter_that_reads_a_number_otherwise_is_found_by_channel_and_member(
    rover, rover_config, recorded_rover
):
    class Wrong(rover):
        def decode(self, frame, stamp):
            return super().decode(frame.replace(b"moved 0.1", b"moved 1"), stamp)

    found = replay(Wrong, rover_config, recorded_rover)
    assert channels(found) == {"position"}
    assert "pose.position.x: recorded 0.1, now 1.0" in str(found.found[0])


def test_an_adapter_that_reports_no_more_is_found(rover, rover_config, recorded_rover):
    class Silent(rover):
        def decode(self, frame, stamp):
            return [
                each for each in super().decode(frame, stamp) if not isinstance(each, fleet.BatteryReport)
            ]

    found = replay(Silent, rover_config, recorded_rover)
    assert channels(found) == {"battery"}
    assert "is not reported now" in found.found[0].what


def test_a_report_that_was_not_made_then_is_found(rover, rover_config, recorded_rover):
    class More(rover):
        def decode(self, frame, stamp):
            yield from super().decode(frame, stamp)
            yield fleet.ImuReport(stamp, fleet.Vector3(), fleet.Vector3())

    assert channels(replay(More, rover_config, recorded_rover)) == {"imu"}


def test_an_adapter_that_fails_on_a_frame_is_found(rover, rover_config, recorded_rover):
    class Failing(rover):
        def decode(self, frame, stamp):
            raise KeyError("charge")

    assert "the adapter failed: KeyError" in {
        each.what.partition("'")[0].rstrip(": ")
        for each in replay(Failing, rover_config, recorded_rover).found
    }


def test_an_adapter_that_fails_to_close_what_it_entered_is_found(rover_config, recorded_rover):
    class Closing(fleet.Adapter):
        Config = type(rover_config)

        @staticmethod
        def replayed(config, robot):
            return Closing(config, robot)

        @contextlib.asynccontextmanager
        async def session(self):
            yield
            raise self.error

        async def connect(self):
            await self.robot.enter(self.session())

        async def stop(self, reason):
            pass

        def halt(self):
            pass

    def failures(error):
        Closing.error = error
        found = replay(Closing, rover_config, recorded_rover).found
        return [each.what for each in found if each.channel == "adapter"]

    assert failures(KeyError("closed")) == [
        "the adapter failed to close what it had entered: KeyError: 'closed'"
    ]
    assert failures(fleet.LinkLost("the link is gone")) == []


def test_of_a_recording_that_begins_later_the_first_seconds_are_left_out(rover, rover_config, recorded_rover):
    later = msgspec.structs.replace(recorded_rover, frames=recorded_rover.frames[1:])
    found = replay(rover, rover_config, later)
    assert (found.is_whole, found.since) == (False, later.frames[0][1].at + SETTLED)


def test_an_adapter_that_says_nothing_of_replays_is_refused_and_not_run(rover_config, recorded_rover):
    class Sdk(fleet.Adapter):
        Config = type(rover_config)

        async def connect(self):
            raise AssertionError("it would reach a robot")

        async def stop(self, reason):
            pass

        def halt(self):
            pass

    with pytest.raises(Refused, match="Sdk cannot be replayed"):
        replay(Sdk, rover_config, recorded_rover)


def test_a_robot_without_frames_is_refused(rover, rover_config, recorded_rover):
    with pytest.raises(Refused, match="no frames of rover"):
        replay(rover, rover_config, msgspec.structs.replace(recorded_rover, frames=()))


def test_nothing_outside_is_reached_even_when_the_robot_is_there(
    rover, rover_config, recorded_rover, monkeypatch
):
    async def reach(*_):
        raise AssertionError("a link was opened")

    monkeypatch.setattr("fleet.link.memory.open_memory", reach)
    assert replay(rover, rover_config, recorded_rover).found == ()
