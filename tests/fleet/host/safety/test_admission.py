"""The gate as a whole: what its rules do together, for velocities of zero above all."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.host.safety.admission import Admission
from fleet.host.safety.emergency_stop import EmergencyStopLatch
from fleet.host.safety.verb_speeds import VerbSpeeds
from fleet.model.command import Command, Origin, Setpoint, Transport
from fleet.model.geometry import ZERO_VELOCITY, Vector3, Velocity
from fleet.robot_config import AdapterConfig, Limits
from fleet.testing.clock import ManualClock

PAUSE = 0.5  # s, the default of setpoint_lease
SKEW = 0.3  # s, the default of clock_skew
FORWARD = Velocity(Vector3(x=1.0))


class Gate:
    """An admission with a clock that the test turns."""

    def __init__(self, **config):
        self.clock = ManualClock(monotonic=0.0)
        self.began = self.clock.time()
        limits = Limits(speed=2.0)
        robot = AdapterConfig(name="rex", twin="6f0c9a1e-0000-4000-8000-000000000001", **config)
        self.latch = EmergencyStopLatch()
        self.rules = Admission(robot, self.clock, self.latch, VerbSpeeds(limits))

    def until(self, at: float) -> None:
        """Turn the clock to so many seconds after the begin."""
        self.clock.advance(max(0.0, at - self.clock.monotonic()))

    def drive(self, session="anna", *, sent=None, velocity=FORWARD, source="tele"):
        """Judge a velocity that was sent at ``sent``, now where that is left out; return the refusal."""
        stamp = self.clock.time() if sent is None else self.began + sent
        request = Setpoint(velocity, origin=Origin(Transport.CLOUD, source, session), stamp=stamp)
        untimely = self.rules.is_untimely_zero(request)
        return self.rules.untimely_zero(request) if untimely else self.rules.setpoint(request)

    def zero(self, session="anna", *, sent=None, **fields):
        return self.drive(session, sent=sent, velocity=ZERO_VELOCITY, **fields)

    def stop(self, session="bert", *, sent=None, name="stop"):
        stamp = self.clock.time() if sent is None else self.began + sent
        if name == "emergency_stop":
            self.latch.engage("asked")
        self.rules.stopped(Command(name, origin=Origin(Transport.CLOUD, "tele", session), stamp=stamp))


@pytest.mark.parametrize("sent", [-3600.0, -60.0, -1.9, -0.6, 0.0, 0.4, 5.0, 3600.0])
def test_a_zero_passes_the_age_rule_however_late_or_early_its_stamp_is(sent):
    gate = Gate()
    assert gate.zero(sent=sent) is None


def test_a_zero_that_was_overtaken_by_a_velocity_passes():
    gate = Gate()
    assert gate.drive(sent=0.0) is None
    assert "older than a setpoint" in gate.drive(sent=-0.1)
    assert gate.zero(sent=-0.1) is None


def test_a_late_zero_gives_control_back_and_never_takes_it():
    gate = Gate()
    assert gate.drive("anna") is None
    assert "anna has control" in gate.drive("bert")
    assert gate.zero("anna", sent=-5.0) is None
    assert gate.drive("bert") is None
    assert "bert has control" in gate.zero("anna", sent=-5.0), "nobody ends what another drives by a zero"
    gate.until(10.0)
    assert gate.zero("anna", sent=-5.0) is None
    assert gate.drive("bert") is None


def test_a_late_zero_of_a_source_that_is_not_obeyed_is_refused():
    assert "source_type 'sim'" in Gate().zero(sent=-5.0, source="sim")


def test_a_zero_from_before_somebody_else_s_stop_is_not_letting_go_after_it():
    gate = Gate()
    assert gate.drive("anna") is None
    gate.until(0.3)
    gate.stop("bert")
    gate.until(0.5)
    assert gate.zero("anna", sent=0.2) is None, "it passes"
    for step in range(20):
        gate.until(0.5 + step * 0.1)
        assert gate.drive("anna") is not None, "and yet she holds the stick"
    assert gate.zero("anna") is None
    gate.until(3.1)
    assert gate.drive("anna") is None


def test_a_stick_that_is_held_behind_an_emergency_stop_does_not_drive_at_its_release():
    gate = Gate()
    assert gate.drive("anna") is None
    gate.stop("bert", name="emergency_stop")
    for step in range(1, 30):
        gate.until(step * 0.1)
        assert gate.drive("anna") is not None
    gate.latch.release()
    for step in range(30, 60):
        gate.until(step * 0.1)
        assert "another sender stopped it: release the stick" in gate.drive("anna")
    gate.zero("anna")
    assert gate.drive("anna") is None


def test_a_zero_passes_a_stop_a_fault_and_a_hold_and_lets_go_if_it_is_not_late():
    gate = Gate()
    assert gate.drive("anna") is None
    gate.stop("bert", name="emergency_stop")
    gate.until(1.0)
    gate.drive("anna")
    assert gate.zero("anna", sent=-5.0) is None
    gate.latch.release()
    gate.latch.held = "the edge is silent"
    assert "is silent" in gate.drive("anna")
    assert gate.zero("anna") is None
    gate.latch.held, gate.rules.fault = "", "a motor is hot"
    assert "a motor is hot" in gate.drive("anna")
    assert gate.zero("anna") is None
    gate.rules.fault = ""
    assert gate.drive("anna") is None, "she has let go"


@pytest.mark.parametrize("skew", [0.3, 1.0, 2.0])
def test_a_stick_that_is_held_while_its_velocities_are_too_late_is_still_held(skew):
    gate = Gate(clock_skew=skew)
    assert gate.drive("anna") is None
    gate.stop("bert")
    for step in range(1, 50):
        gate.until(step * 0.1)
        assert gate.drive("anna") is not None


MESSAGES = st.lists(
    st.tuples(
        st.sampled_from(["drive", "drive", "drive", "zero", "stop", "own stop"]),
        st.sampled_from([0.01, 0.1, 0.2, 0.3, 0.4, 0.6]),  # s since the one before was sent
        st.sampled_from([0.0, 0.0, 0.0, 0.1, 0.3, 0.6, 3.0]),  # s on the way
    ),
    max_size=25,
)


@settings(max_examples=600, deadline=None)
@given(MESSAGES, st.floats(-SKEW, SKEW), st.floats(-SKEW, SKEW))
def test_whatever_the_stamps_and_the_order_a_zero_passes_and_none_from_before_a_stop_lets_go(
    messages, anna, bert
):
    """Anna drives, Bert stops; their clocks are off by no more than the skew."""
    gate, sent, flights = Gate(), 0.0, []
    for kind, after, delay in messages:
        sent += after
        flights.append((sent + delay, sent, kind))
    last = -10.0  # when a velocity of Anna's came that was not zero
    stopped = None  # when the stop was sent that she has not let go after
    for came, sent, kind in sorted(flights):
        gate.until(came)
        if kind == "stop":
            stopped = max(sent, stopped or sent) if came - last < PAUSE else None
            gate.stop("bert", sent=sent + bert)
        elif kind == "own stop":
            gate.stop("anna", sent=sent + anna)
            last, stopped = -10.0, None  # who stops has let go: Bert's stop after it finds nobody driving
        elif kind == "zero":
            assert gate.zero("anna", sent=sent + anna) is None
            if stopped is not None and sent >= stopped:
                stopped = None
        else:
            if came - last >= PAUSE - 1e-6:
                stopped = None
            refusal = gate.drive("anna", sent=sent + anna)
            assert refusal is not None or stopped is None
            last = came
