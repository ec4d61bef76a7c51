"""No frame on a bus, whoever sends it, ends the control loop of a dog or makes its feedback unusable."""

import math
import struct

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fleet import CanFrame
from fleet_quadruped.drives import drive_kind, drives_of
from fleet_quadruped.drives.moteus import frames as moteus
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.lockstep import SimBus
from tests.adapters.fleet_quadruped.copies import standing_dog

NUMBERS = [math.nan, math.inf, -math.inf, 3.4e38, 0.0, 1e-45]
BYTES = st.one_of(
    st.binary(max_size=64),
    st.lists(st.sampled_from(NUMBERS), max_size=4).map(lambda them: struct.pack(f"<{len(them)}f", *them)),
)
MOTEUS_ANSWERS = st.lists(
    st.tuples(
        st.integers(0, 3),
        st.sampled_from([moteus.MODE, moteus.POSITION, moteus.HOME, moteus.VOLTAGE, moteus.FAULT]),
        st.lists(st.sampled_from([0.0, 1.0, 10.0, 200.0, *NUMBERS]), min_size=1, max_size=4),
    ),
    max_size=3,
).map(
    lambda parts: b"".join(
        moteus.pack_reply(size, start, tuple(v if size == 3 or math.isfinite(v) else 99.0 for v in values))
        for size, start, values in parts
    )
)


def identifiers_of(dog):
    """Return the identifiers that mean something to the drives of a dog, and to its sensors."""
    kind = drive_kind(dog.drive.protocol)
    own = [each for joint in dog.all_joints for each in kind.identifiers(dog.drive, joint)]
    sensors = [frame.id for part in (dog.imu, dog.battery) if part for frame in part.frames]
    return [*own, *kind.shared(dog), *sensors]


FRAMES = {}


def any_frames(dog):
    """Return a strategy for lists of frames, made once for each kind of drives."""
    protocol = dog.drive.protocol
    if protocol not in FRAMES:
        FRAMES[protocol] = new_frames(dog)
    return FRAMES[protocol]


def new_frames(dog):
    """Return a strategy for lists of frames, most of them with identifiers of the dog."""
    number = st.one_of(st.sampled_from(identifiers_of(dog)), st.integers(0, 0x1FFFFFFF))
    frames = st.builds(CanFrame, number, BYTES)
    if dog.drive.protocol == "moteus":
        replies = st.sampled_from([moteus.from_servo(joint.id) for joint in dog.all_joints])
        frames = st.one_of(frames, st.builds(CanFrame, replies, MOTEUS_ANSWERS))
    return st.lists(frames, max_size=12)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_frames_leave_feedback_that_is_made_of_numbers(any_dog, data):
    drives = drives_of(any_dog, {name: SimBus(name) for name in any_dog.buses})
    for frame in data.draw(any_frames(any_dog)):
        drives.handle_frame("a", frame, 1.0)
        drives.target("a", frame)
    feedback = drives.feedback(1.0)
    numbers = [*feedback.angles, *feedback.speeds, *feedback.torques]
    numbers += [each for each in (*feedback.temperatures, *feedback.voltages) if each is not None]
    assert all(map(math.isfinite, numbers))


@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_frames_leave_the_control_loop_running(any_dog, data):
    """Whatever a dog that stands believes of them, it answers in the next cycle and is damped or stands.

    Standing up costs a hundred times as much as a cycle: few dogs, many cycles.
    """
    rig = standing_dog(any_dog)
    for _ in range(8):
        for frame in data.draw(any_frames(any_dog)):
            rig.buses["a"].arrive(frame)
        rig.cycle()
    assert rig.state().mode in {each.value for each in BodyMode}
    rig.emergency()
    rig.cycle()
    assert rig.mode in {BodyMode.DAMPED, BodyMode.OFF}


@pytest.mark.parametrize(
    "query", [b"\x15\x00\x15\x0f", b"\x10\x04\x00\x14\x04\x0c", b"\x11\x01"], ids=["partial", "int8", "angle"]
)
def test_another_host_tool_that_reads_the_servos_disturbs_no_standing_dog(dogs, query):
    rig = standing_dog(dogs["moteus"])
    before = rig.state().angles
    for _ in range(100):
        for joint in rig.dog.all_joints:
            rig.sim.handle_frame("a", CanFrame(moteus.to_servo(joint.id), moteus.padded(query), fd=True))
        rig.cycle()
        assert (rig.mode, rig.fault) == (BodyMode.STANDING, "")
        assert rig.state().angles == pytest.approx(before, abs=0.01)
