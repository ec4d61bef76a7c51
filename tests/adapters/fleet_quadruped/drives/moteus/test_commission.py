"""What is asked of moteus servos before they may move, what is set in them, and why they are refused."""

import math

import pytest

from fleet import CanFrame
from fleet.errors import LinkLost, LinkRefused
from fleet_quadruped.drives.drive_requester import DriveRequester
from fleet_quadruped.drives.moteus import frames
from fleet_quadruped.drives.moteus.commission import Diagnostics, commission
from fleet_quadruped.drives.moteus.servo import MoteusServo
from fleet_quadruped.drives.motor_units import Units
from fleet_quadruped.sim.moteus import SimMoteus
from fleet_quadruped.sim.world import SimMotor

KP, KD, KI = (f"servo.pid_position.{name}" for name in ("kp", "kd", "ki"))
SAFETY_KD = 3.0  # N m s/rad
TURN = math.tau


class Bench:
    """Two simulated servos on a bus, of joints with a ratio, and their state on our side.

    ``said``: the text lines that the servos were sent; ``noise``: text for others before an answer;
    ``late``: an answer comes with the next poll.
    """

    name = "a"

    def __init__(self, joint_of, ratio=1.0, **kind):
        joints = [
            joint_of(f"FL_{part}", number=number, ratio=ratio, **kind)
            for number, part in ((1, "hip"), (2, "knee"))
        ]
        self.sims = [SimMoteus(joint, SimMotor(), self._answer, None) for joint in joints]
        self.servos = [self._servo(joint) for joint in joints]
        self.requester = DriveRequester({"a": self}, self._take)
        self.diagnostics = Diagnostics(self.servos, self.requester)
        self._answers, self.said, self.noise, self.late = [], [], b"", False

    def _servo(self, joint):
        square = joint.kind.ratio**2
        gains = [gain / square * TURN for gain in (joint.kind.kp, joint.kind.kd)]
        return MoteusServo(joint, self, joint.id, Units(joint), *gains, 0.1)

    def send(self, frame):
        text = b"".join(part.text for part in frames.unpack(frame.data) if part.kind == 0x40)
        self.said += [text.decode()] if text else []
        if text and self.late:
            frame = CanFrame(frame.id, bytes([0x40, 1, len(text)]) + text, fd=True)
        for sim in self.sims:
            if frame.id in sim.hears:
                sim.hears[frame.id](frame)

    def receive(self, wait):
        answers, self._answers = self._answers, []
        return answers

    def _answer(self, frame):
        self._answers.append(frame)

    def _take(self, bus, frame, now):
        servo = next(servo for servo in self.servos if frames.from_servo(servo.id) == frame.id)
        parts = frames.unpack(frame.data)
        for part in parts:
            if part.kind == 0x41 and part.text:
                self.diagnostics.handle_text(servo, self.noise + part.text[:3])
                self.diagnostics.handle_text(servo, part.text[3:])
        registers = frames.reply(parts)
        if registers is not None:
            servo.handle_registers(registers, frame.data, now)

    def commission(self):
        commission(self.servos, self.requester, self.diagnostics, SAFETY_KD)

    def refused(self):
        with pytest.raises(LinkRefused) as caught:
            self.commission()
        return str(caught.value)

    def store(self, **values):
        """Configure the second servo."""
        self.sims[1].config.update({f"servo.pid_position.{name}": value for name, value in values.items()})
        return self


@pytest.fixture
def make(joint_of):
    return lambda *ratio, **kind: Bench(joint_of, *ratio, **kind)


@pytest.mark.parametrize("ratio", [1.0, 6.0])
def test_its_commands_are_shares_of_the_gains_that_are_configured(make, ratio):
    bench = make(ratio)
    bench.commission()
    for servo in bench.servos:
        assert servo.kp_scale == pytest.approx(60 / 120, rel=1e-3)
        assert servo.kd_scale == pytest.approx(2 / 5, rel=1e-3)
        assert servo.full_kd == pytest.approx(5 / ratio**2 * TURN, rel=1e-3)


@pytest.mark.parametrize("ratio", [1.0, 6.0])
def test_after_silence_it_damps_with_at_most_the_torque_of_its_joint(make, ratio):
    bench = make(ratio)
    bench.commission()
    for sim in bench.sims:
        assert sim.config["servo.timeout_mode"] == frames.DAMPS
        assert sim.config["servo.timeout_max_torque_Nm"] == 24.0 / ratio


@pytest.mark.parametrize(
    ("stored", "expected"),
    [
        ({"kp": 4.0}, "kp is 4, wanted 376.991 or more (N m/turn)"),
        ({"kd": 1.0}, "kd is 1, wanted 25.1327 or more (N m s/turn)"),
        ({"kd": 20.0}, "kd is 20, wanted 25.1327 or more (N m s/turn)"),
        ({"kp": 377.0, "kd": 18.0}, "kd is 18, wanted 18.8496 or more (N m s/turn)"),  # that of the stop
        ({"ki": 0.5}, "ki is 0.5, wanted 0"),
        ({"ki": -0.5}, "ki is -0.5, wanted 0"),
    ],
)
def test_a_servo_that_cannot_have_the_gains_is_refused(make, stored, expected):
    assert make().store(**stored).refused() == f"FL_knee: servo.pid_position.{expected}"


def test_gains_that_are_rounded_are_not_too_small(make):
    make().store(kp=376.8, kd=18.84).commission()


def test_joints_without_stiffness_need_only_the_damping_of_a_stop(make):
    bench = make(kp=0.0).store(kp=0.0, kd=18.85)
    bench.commission()
    assert [servo.kp_scale for servo in bench.servos] == [0.0, 0.0]


def test_a_place_that_refers_to_nothing_is_refused(make):
    bench = make()
    bench.sims[1].home = frames.REFERS_TO_NOTHING
    assert bench.refused() == "FL_knee: its position has no reference (register 00Ch is 0): home it"


def test_a_place_that_refers_to_the_rotor_is_refused_behind_a_gear_and_not_without_one(make):
    geared, direct = make(6.0), make(1.0)
    for bench in (geared, direct):
        bench.sims[1].home = frames.REFERS_TO_ROTOR
    assert geared.refused() == (
        "FL_knee: its position refers to the rotor (register 00Ch is 1), and the joint turns once for "
        "6 of it: set the output's place (d exact)"
    )
    direct.commission()


def test_a_servo_that_does_not_take_a_setting_is_refused(make):
    bench = make()
    bench.sims[1].refuse()
    assert bench.refused() == f"FL_knee: servo.timeout_mode is 0, wanted {frames.DAMPS}"


@pytest.mark.parametrize(
    ("value", "expected"), [(math.nan, "'nan'"), (math.inf, "'inf'"), (None, "'ERR unknown'")]
)
def test_a_value_that_is_no_number_is_refused(make, value, expected):
    bench = make().store(kp=value)
    if value is None:
        del bench.sims[1].config[KP]
    assert bench.refused() == f"FL_knee: {KP} is {expected}, which is not a number"


def test_a_silent_servo_is_lost(make):
    bench = make()
    bench.sims[1].mute()
    with pytest.raises(LinkLost, match=r"^FL_knee: id 2 on bus 'a' is silent; check power, wiring, id"):
        bench.commission()


def test_a_servo_that_restarted_is_asked_anew_and_trusted_again(make):
    bench = make()
    bench.commission()
    bench.servos[0].restarted, before = True, bench.servos[0].home
    bench.sims[0].home = frames.REFERS_TO_NOTHING
    assert "no reference" in bench.refused()
    assert (bench.servos[0].restarted, before) == (False, frames.REFERS_TO_OUTPUT)


def test_a_line_is_sent_once_though_its_answer_comes_later(make):
    bench = make()
    bench.late = True
    assert bench.diagnostics.read(KP) == pytest.approx([120 * TURN] * 2, rel=1e-6)
    assert bench.said == [f"conf get {KP}\n"] * 2


def test_a_value_is_set_in_each_servo_and_read_back(make):
    bench = make()
    bench.diagnostics.write("servo.timeout_max_torque_Nm", [1.5, 2.25])
    assert [sim.config["servo.timeout_max_torque_Nm"] for sim in bench.sims] == [1.5, 2.25]
    assert [line.split()[1] for line in bench.said] == ["set", "set", "get", "get"]


def test_text_that_another_tool_has_asked_for_is_not_taken_for_the_answer(make):
    bench = make()
    bench.noise = b"tel text\r\n" * 200
    assert bench.diagnostics.read(KI) == [0.0, 0.0]


def test_text_without_end_is_not_kept(make):
    bench = make()
    for _ in range(100):
        bench.diagnostics.handle_text(bench.servos[0], bytes(100))
    assert len(bench.diagnostics._texts["FL_hip"]) == 512
