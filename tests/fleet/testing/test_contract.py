"""The contract tests catch what they are for: each of these robots breaks one rule."""

import struct
import time
from typing import Literal

import pytest
from pydantic import Field, ValidationError

from fleet.adapter import Adapter, AdapterConfig, FrameAdapter
from fleet.commands import command
from fleet.errors import FleetError, Refused
from fleet.model.geometry import ZERO_VELOCITY, Vector3, Velocity
from fleet.model.report import BatteryReport, JointReport
from fleet.robot_config import Limits
from fleet.testing import probes
from fleet.testing.contract import STAMP, AdapterContract, FrameContract


class GoodConfig(AdapterConfig):
    adapter: Literal["good"]
    link: str = Field("memory:good", description="Where it is.")


class Good(FrameAdapter[GoodConfig]):
    """A robot that keeps every rule."""

    Config = GoodConfig
    limits = Limits(speed=1.0)

    def drive(self, velocity):
        yield b"M %g\n" % velocity.linear.x

    def decode(self, frame, stamp):
        if frame == b"B 1":
            yield BatteryReport(stamp, percent=1.0)

    def halt(self):
        yield b"s\n"


class TestAGoodFrameAdapter(FrameContract):
    adapter = Good
    config = {"adapter": "good"}
    said = (b"B 1\n",)

    def velocity_of(self, frame):
        if frame == b"s\n":
            return ZERO_VELOCITY
        return Velocity(Vector3(float(frame[2:]))) if frame.startswith(b"M") else None


class Brainy(Adapter[GoodConfig]):
    """A robot with a brain that keeps every rule."""

    Config = GoodConfig
    failsafe = "it stops after 1 s without a word of ours"

    async def connect(self): ...

    async def stop(self, reason): ...

    def halt(self): ...

    @command("dance")
    async def dance(self):
        """Dance."""
        raise Refused("not connected")


class TestAGoodAdapter(AdapterContract):
    adapter = Brainy
    config = {"adapter": "good"}


def broken(contract=FrameContract, base=Good, **changes):
    """Return the contract for an adapter that differs from a good one."""
    adapter = type("Broken", (base,), {"__doc__": "A broken robot.", **changes})
    return type(
        "Contract", (contract,), {"adapter": adapter, "config": {"adapter": "good"}, "said": (b"B 1\n",)}
    )()


def slow(self, *_):
    time.sleep(0.3)
    yield b"x\n"


def fails(self, *_):
    raise RuntimeError("a bug")


class Undescribed(GoodConfig):
    speed: float = 1.0


class Loose(GoodConfig):
    model_config = {"extra": "ignore"}


shared = []


def remember(self, frame, stamp):
    shared.append(frame)
    return ()


def greet_as_often(self):
    return [b"x\n"] * len(shared)


async def crash(self):
    """Crash."""
    raise RuntimeError("a bug")


@pytest.mark.parametrize(
    ("test", "changes"),
    [
        ("an_unknown_config_field_is_refused", {"Config": Loose}),
        ("every_config_field_of_its_own_is_described", {"Config": Undescribed}),
        ("the_adapter_says_what_it_is_for", {"__doc__": ""}),
        ("every_command_has_a_plain_name_and_a_bounded_time", {"sit": command("Sit down")(lambda self: ())}),
        ("every_command_method_says_what_it_does", {"wave": command("wave")(lambda self: ())}),
        ("a_robot_that_drives_says_how_fast", {"limits": Limits()}),
        ("each_example_of_what_the_robot_says_means_something", {"decode": lambda *_: ()}),
        ("halt_is_never_empty_and_works_at_any_time", {"halt": lambda self: [b""]}),
        ("halt_is_never_empty_and_works_at_any_time", {"halt": fails}),
        ("every_velocity_becomes_frames_or_is_refused", {"drive": lambda *_: ()}),
        ("every_velocity_becomes_frames_or_is_refused", {"drive": fails}),
        ("standing_still_is_never_refused", {"drive": lambda *_: ()}),
        ("hello_and_tick_yield_frames", {"tick": lambda self: ["text"]}),
        ("decode_survives_whatever_arrives", {"decode": lambda self, frame, stamp: [float(frame)]}),
        ("decode_survives_whatever_arrives", {"decode": lambda self, *_: [BatteryReport(1.0, float("nan"))]}),
        ("one_robots_frames_do_not_change_another", {"decode": remember, "hello": greet_as_often}),
    ],
)
def test_a_broken_frame_adapter_is_caught(test, changes):
    with pytest.raises((AssertionError, RuntimeError, ValueError, pytest.fail.Exception)):
        getattr(broken(**changes), f"test_{test}")()


@pytest.mark.parametrize(
    ("test", "changes", "expected"),
    [
        (
            "each_example_of_what_the_robot_says_means_something",
            {"decode": lambda *_: ()},
            "leave frames without a report out of said",
        ),
        (
            "every_velocity_becomes_frames_or_is_refused",
            {"drive": lambda self, velocity: [struct.pack("<h", round(velocity.linear.x))]},
            "clamp it, or raise Refused",
        ),
        (
            "decode_survives_whatever_arrives",
            {"decode": lambda self, *_: [BatteryReport(STAMP, percent=250.0)]},
            r"BatteryReport.percent is \[250.0\], beyond 0 to 100",
        ),
        (
            "decode_survives_whatever_arrives",
            {"decode": lambda self, *_: [BatteryReport(STAMP, voltage=25600)]},
            r"BatteryReport.voltage is \[25600\], beyond 0 to 1000",
        ),
        (
            "halt_is_never_empty_and_works_at_any_time",
            {"halt": lambda self: [b""]},
            r"halt must yield bytes that are not empty, not \[b''\]",
        ),
        (
            "every_command_method_says_what_it_does",
            {"wave": command("wave")(lambda self: ())},
            "need a docstring, which is their help: wave",
        ),
    ],
)
def test_a_failure_names_what_to_change(test, changes, expected):
    with pytest.raises(AssertionError, match=expected):
        getattr(broken(**changes), f"test_{test}")()


@pytest.mark.parametrize("test", ["halt_is_never_empty_and_works_at_any_time", "hello_and_tick_yield_frames"])
def test_an_adapter_that_blocks_is_caught(test, monkeypatch):
    monkeypatch.setattr(probes, "SOON", 0.05)
    with pytest.raises(AssertionError, match="blocks"):
        getattr(broken(halt=slow, hello=slow), f"test_{test}")()


@pytest.mark.parametrize(
    ("test", "changes"),
    [
        ("two_robots_share_no_state", {"queue": []}),
    ],
)
def test_a_broken_adapter_is_caught(test, changes):
    with pytest.raises((AssertionError, RuntimeError)):
        getattr(broken(AdapterContract, Brainy, **changes), f"test_{test}")()


def test_an_example_config_that_is_wrong_is_caught():
    contract = broken()
    type(contract).config = {"adapter": "other"}
    with pytest.raises(ValidationError):
        contract.test_the_example_config_is_accepted()


def test_a_truth_value_is_no_measurement():
    assert list(probes.numbers_in({"armed": True, "satellites": 3, "speed": 0.5})) == [3, 0.5]


def test_a_whole_number_of_any_size_is_finite():
    assert not probes.implausible(JointReport(STAMP, {}, {"left": 10**400}), STAMP)


def test_a_refusal_is_no_failure():
    def refuse():
        raise Refused("no")

    assert probes.unless_refused(refuse) is None
    with pytest.raises(FleetError):
        probes.in_time(refuse)
