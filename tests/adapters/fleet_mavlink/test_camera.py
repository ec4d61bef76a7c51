"""Pictures: commanded once, seen to be taken, and never taken for granted."""

import asyncio

import pytest

from fleet import Fault, NotReady, Refused, TimedOut, Unsupported
from fleet_mavlink.camera import CameraComponent, Photo
from fleet_mavlink.commander import CommandTimeouts
from fleet_mavlink.constants import MavCmd, MavResult
from fleet_mavlink.messages import CommandAck, CommandLong, Heartbeat
from fleet_mavlink.payload_messages import CameraImageCaptured

CAMERA = 100
ACCEPTED = CommandAck(MavCmd.IMAGE_START_CAPTURE, MavResult.ACCEPTED)
TAKEN = CameraImageCaptured(7, 1, "/DCIM/0007.jpg")


class Shots:
    """A vehicle with a camera; each of ``answers`` is what the camera says to one more command."""

    def __init__(self, it, answers):
        self.it, self.answers = it, answers
        self.camera = CameraComponent(it.vehicle, CommandTimeouts())

    def beats(self, component=CAMERA, kind=30):
        self.it.vehicle.handle_component_message(component, Heartbeat(kind, 8))

    def says(self, *messages, component=CAMERA):
        for message in messages:
            self.it.vehicle.handle_component_message(component, message)

    @property
    def sent(self):
        return [each for each in self.it.sent if isinstance(each, CommandLong)]


@pytest.fixture
def shots(run_answered):
    """Run a test with a camera that was heard, and answers of it."""

    def run(test, *answers):
        left = list(answers)

        async def main(it):
            one = Shots(it, left)
            it.sent._receive = one.says
            one.beats()
            await test(one)

        run_answered(lambda _message: left.pop(0) if left else [], main)

    return run


def test_a_picture_is_commanded_to_the_camera_and_told_with_its_place(shots):
    async def test(it):
        assert await it.camera.take_photo() == Photo(7, "/DCIM/0007.jpg")
        (sent,) = it.sent
        assert (sent.command, sent.target_component) == (MavCmd.IMAGE_START_CAPTURE, CAMERA)
        assert (sent.param1, sent.param2, sent.param3, sent.param4) == (0.0, 0.0, 1.0, 1.0)

    shots(test, [ACCEPTED, TAKEN])


def test_each_picture_has_a_number_of_its_own_so_that_a_camera_knows_a_repeat(shots):
    async def test(it):
        for _ in range(3):
            await it.camera.take_photo()
        assert [each.param4 for each in it.sent] == [1.0, 2.0, 3.0]

    shots(test, *[[ACCEPTED, TAKEN]] * 3)


def test_a_picture_that_comes_before_the_acknowledgement_counts(shots):
    async def test(it):
        assert (await it.camera.take_photo()).index == 7

    shots(test, [TAKEN, ACCEPTED])


def test_a_command_without_an_answer_is_not_repeated_for_it_might_take_two_pictures(shots):
    async def test(it):
        with pytest.raises(TimedOut, match="did not answer"):
            await it.camera.take_photo()
        assert len(it.sent) == 1

    shots(test)


def test_a_picture_that_is_not_seen_to_be_taken_is_no_picture(shots):
    async def test(it):
        began = it.it.vehicle.now()
        asyncio.get_running_loop().call_later(3.0, it.beats)
        with pytest.raises(TimedOut, match="accepted the command but reported no picture"):
            await it.camera.take_photo()
        assert it.it.vehicle.now() - began == pytest.approx(5.0, abs=0.1)

    shots(test, [ACCEPTED])


@pytest.mark.parametrize("result", [0, -1, 2])
def test_a_failed_picture_is_a_fault_with_what_to_look_at(shots, result):
    async def test(it):
        with pytest.raises(Fault, match="could not take the picture") as fault:
            await it.camera.take_photo()
        assert fault.value.hint == "is its card full?"

    shots(test, [ACCEPTED, CameraImageCaptured(7, result, "")])


def test_a_camera_that_refuses_says_so(shots):
    async def test(it):
        with pytest.raises(Refused):
            await it.camera.take_photo()

    shots(test, [CommandAck(MavCmd.IMAGE_START_CAPTURE, MavResult.DENIED)])


def test_a_picture_of_before_is_not_taken_for_this_one(shots):
    async def test(it):
        it.says(TAKEN)
        with pytest.raises(TimedOut):
            await it.camera.take_photo()

    shots(test, [ACCEPTED])


def test_another_components_picture_is_not_the_cameras(shots):
    async def test(it):
        asyncio.get_running_loop().call_later(1.0, lambda: it.says(TAKEN, component=CAMERA + 1))
        with pytest.raises(TimedOut):
            await it.camera.take_photo()

    shots(test, [ACCEPTED])


def test_without_a_camera_or_with_a_silent_one_no_command_is_sent(run_answered):
    async def test(it):
        camera = CameraComponent(it.vehicle, CommandTimeouts())
        it.vehicle.handle_component_message(CAMERA, TAKEN)  # not a heartbeat of a camera
        with pytest.raises(Unsupported, match="no camera of this vehicle has sent a heartbeat"):
            await camera.take_photo()
        it.vehicle.handle_component_message(CAMERA, Heartbeat(30, 8))
        await asyncio.sleep(4.0)
        with pytest.raises(NotReady, match="no heartbeat"):
            await camera.take_photo()
        it.vehicle.handle_component_message(CAMERA, Heartbeat(30, 8))
        it.vehicle.handle_component_message(CAMERA, Heartbeat(30, 8))
        it.silent = True
        await asyncio.sleep(2.9)
        it.vehicle.handle_component_message(CAMERA, Heartbeat(30, 8))
        await asyncio.sleep(1.0)
        with pytest.raises(NotReady, match="no heartbeat from system 1"):
            await camera.take_photo()
        assert it.sent == []

    run_answered(lambda _message: [], test)
