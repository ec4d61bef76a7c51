import builtins
import contextlib
import os
import pty
import threading
import tty

import pytest
import serialx

from fleet.errors import LinkLost, LinkRefused, NotReady
from fleet.link.latest_motion import LatestMotion
from fleet.link.motion_sender import MotionSender
from fleet.link.url import open_link
from fleet.model.geometry import Vector3, Velocity
from fleet.testing.clock import ManualClock


class Port:
    """A pseudo-terminal: ``robot`` is the robot's end."""

    def __init__(self):
        self.robot, self._device = pty.openpty()
        tty.setraw(self._device)
        self.url = f"serial:{os.ttyname(self._device)}?baud=115200"

    def unplug(self):
        for descriptor in (self.robot, self._device):
            with contextlib.suppress(OSError):
                os.close(descriptor)


@pytest.fixture
def port():
    port = Port()
    yield port
    port.unplug()


@pytest.fixture
async def opened(port, receiver):
    heard = receiver()
    link = await open_link(port.url, heard)
    yield link, heard
    await link.close()


def flood(link):
    for _ in range(100_000):
        link.send(b"M 0.5 0.0\n")


async def test_bytes_go_both_ways(port, opened):
    link, heard = opened
    link.send(b"ping\n\x00\xff")
    assert os.read(port.robot, 100) == b"ping\n\x00\xff"
    os.write(port.robot, b"pong\r\n\x11\x13")
    await heard.until(b"pong\r\n\x11\x13")


async def test_a_device_is_open_in_one_program_only(port, opened, receiver):
    with pytest.raises(LinkRefused, match="another program has it open"):
        await open_link(port.url, receiver())


async def test_a_closed_device_can_be_opened_again(port, opened, receiver):
    await opened[0].close()
    heard = receiver()
    again = await open_link(port.url, heard)
    os.write(port.robot, b"hello")
    await heard.until(b"hello")
    await again.close()


async def test_an_unplugged_device_is_noticed(port, opened, loss_reason):
    port.unplug()
    assert opened[0].url in await loss_reason(opened[0])
    with pytest.raises(LinkLost):
        opened[0].send(b"M 1 0\n")


async def test_an_unplugged_device_is_a_lost_link_also_to_who_moves_the_robot_before_the_loop_notices(
    port, opened, loss_reason
):
    link, _ = opened
    motion = MotionSender(
        LatestMotion(link, ManualClock(), baud=115200),
        ManualClock(),
        encode=lambda velocity: (b"M %.1f\n" % velocity.linear.x,),
        stop=lambda: (b"M 0\n",),
        every=0.1,
    )
    motion.drive(Velocity(Vector3(0.5)))
    port.unplug()
    with pytest.raises(NotReady, match="Input/output error"):
        motion.drive(Velocity(Vector3(0.4)))
    motion.halt()
    assert "Input/output error" in await loss_reason(link)


async def test_a_robot_that_does_not_read_costs_the_link_not_the_loop(opened):
    with pytest.raises(LinkLost, match="does not read"):
        flood(opened[0])


async def test_a_stop_goes_out_from_another_thread_while_the_loop_is_stuck(port, opened):
    thread = threading.Thread(target=opened[0].send, args=(b"stop",))
    thread.start()
    thread.join()
    assert os.read(port.robot, 100) == b"stop"


async def test_dtr_and_rts_are_left_alone(port, receiver, monkeypatch):
    pins = []
    monkeypatch.setattr(
        serialx.BaseSerial, "set_modem_pins", lambda self, modem_pins=None, **_: pins.append(modem_pins)
    )
    link = await open_link(port.url, receiver())
    await link.close()
    assert {pin for state in pins for pin in (state.dtr, state.rts)} == {serialx.PinState.UNDEFINED}


async def test_a_device_that_is_not_plugged_in_may_come(receiver):
    with pytest.raises(LinkLost, match="is it plugged in"):
        await open_link("serial:/dev/ttyNOBODY?baud=9600", receiver())


@pytest.mark.parametrize(("path", "reason"), [("/dev/null", "not a serial device"), ("/tmp", "a folder")])
async def test_what_is_no_serial_device_is_refused(receiver, path, reason):
    with pytest.raises(LinkRefused, match=reason):
        await open_link(f"serial:{path}?baud=9600", receiver())


async def test_a_device_without_permission_is_refused_with_what_to_do(port, receiver, monkeypatch):
    def denied(*args, **kwargs):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("serialx.platforms.serial_posix.os.open", denied)
    with pytest.raises(LinkRefused, match="dialout"):
        await open_link(port.url, receiver())


async def test_a_missing_extra_is_named(port, receiver, monkeypatch):
    real = builtins.__import__

    def without_serialx(name, *args, **kwargs):
        if name == "serialx":
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without_serialx)
    with pytest.raises(LinkRefused, match=r"pip install 'zenoh-fleet\[serial\]'"):
        await open_link(port.url, receiver())
