"""A CAN bus as the link of one robot, with the promises that the other links keep."""

import asyncio
import errno
import threading

import can
import pytest

from fleet import CanFrame, LinkLost, LinkRefused
from fleet.adapter import FrameAdapter
from fleet.host.robot.frame_adapter_runner import FrameAdapterRunner
from fleet.link.canbus import link as can_link
from fleet.link.framing import DatagramFraming
from fleet.link.url import open_link, parse_link_url
from fleet.model.geometry import Vector3, Velocity
from fleet.robot_config import AdapterConfig
from fleet.testing.robot import RecordingRobot, serve

WITHIN = 60.0  # s


@pytest.fixture
def url(request):
    return f"can:virtual:{request.node.name.replace('[', '-').replace(']', '')}"


@pytest.fixture
def other(url):
    """Return the robot's end of the bus, as python-can has it."""
    with can.Bus(interface="virtual", channel=parse_channel(url)) as bus:
        yield bus


def parse_channel(url):
    return url.split(":")[2].split("?")[0]


async def until(condition):
    async with asyncio.timeout(WITHIN):
        while not condition():  # noqa: ASYNC110 - a thread of the link makes it true
            await asyncio.sleep(0.005)


def full(*_args, **_kwargs):
    raise can.CanOperationError("No buffer space available", error_code=errno.ENOBUFS)


async def test_a_bus_that_cannot_be_read_is_lost_and_not_silent(url, other, receiver, monkeypatch):
    link = await open_link(url, receiver())

    def fail(_within):
        raise ZeroDivisionError("oops")

    monkeypatch.setattr(link._bus, "receive", fail)
    async with asyncio.timeout(WITHIN):
        with pytest.raises(LinkLost, match="it cannot be read: ZeroDivisionError: oops"):
            await link.lost()
    await link.close()


@pytest.mark.parametrize("frame", [CanFrame(0x111, b"\x01\x02"), CanFrame(0x18FF0102, bytes(8))])
async def test_frames_cross_both_ways_as_they_are(url, other, receiver, frame):
    heard = receiver()
    link = await open_link(url, heard)
    link.send(frame.packed())
    message = other.recv(WITHIN)
    assert (message.arbitration_id, bytes(message.data)) == (frame.id, frame.data)
    assert message.is_extended_id == frame.extended
    other.send(message)
    await heard.until(frame.packed())
    await link.close()


@pytest.mark.waits
async def test_can_fd_crosses_between_processes__by_udp(receiver):
    url = "can:udp_multicast:239.74.163.7?port=43871&data_bitrate=5000000"
    one, other = receiver(), receiver()
    first, second = await open_link(url, one), await open_link(url, other)
    frame = CanFrame(0x8001, bytes(range(48)), fd=True)
    first.send(frame.packed())
    await other.until(frame.packed())
    await first.close()
    await second.close()


async def test_a_fd_frame_on_a_classic_bus_is_a_mistake_that_is_said(url, receiver):
    link = await open_link(url, receiver())
    with pytest.raises(ValueError, match=r"is a classic bus; for CAN FD give it a data_bitrate"):
        link.send(CanFrame(1, bytes(12), fd=True).packed())
    with pytest.raises(ValueError, match=r"is no CAN frame; write CanFrame"):
        link.send(b"abc")
    await link.close()


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        (CanFrame(-1, b""), "is not a CAN identifier"),
        (CanFrame(1 << 29, b""), "20000000h is not a CAN identifier"),
        (CanFrame(1, bytes(9)), "a classic frame has no 9 bytes"),
        (CanFrame(1, bytes(9), fd=True), "a CAN FD frame has no 9 bytes"),
        (CanFrame(1, bytes(1), remote=True), "a remote frame has no 1 bytes"),
    ],
)
def test_what_is_no_frame_is_not_packed(frame, expected):
    with pytest.raises(ValueError, match=expected):
        frame.packed()


def test_a_packed_frame_comes_back():
    for frame in (CanFrame(0x7FF, b"x"), CanFrame(1, b"", remote=True), CanFrame(9, bytes(64), fd=True)):
        assert CanFrame.unpack(frame.packed()) == frame


async def test_a_bus_that_dies_ends_the_link_with_the_words_of_the_quadruped(
    url, other, receiver, loss_reason
):
    link = await open_link(url, receiver())

    def unplugged(*_args, **_kwargs):
        raise can.CanOperationError("Network is down", error_code=errno.ENETDOWN)

    link._bus._bus.send = unplugged
    with pytest.raises(LinkLost, match=r"sending failed: Network is down"):
        link.send(CanFrame(1, b"").packed())
    assert "sending failed: Network is down" in await loss_reason(link)
    with pytest.raises(LinkLost, match="sending failed"):
        link.send(CanFrame(1, b"").packed())
    await link.close()


async def test_what_is_closed_receives_nothing_and_leaves_no_thread(url, other, receiver):
    heard = receiver()
    link = await open_link(url, heard)
    await link.close()
    await link.close()
    other.send(can.Message(arbitration_id=1, data=b"late", is_extended_id=False))
    await asyncio.sleep(0)
    assert heard.data == b""
    assert not link._reader.is_alive()


async def test_a_flood_is_bounded_and_the_newest_are_kept(url, other, receiver, monkeypatch):
    monkeypatch.setattr(can_link, "_BACKLOG", 64)
    heard = receiver()
    link = await open_link(url, heard)
    threads = link._reader

    def flood():
        for number in range(2000):
            other.send(can.Message(arbitration_id=number, is_extended_id=False))

    sender = threading.Thread(target=flood)
    sender.start()
    sender.join()  # the loop is kept busy meanwhile
    while link.stats.dropped == 0 or not link._due:
        assert threads.is_alive()
    await until(lambda: link.stats.received + link.stats.dropped == 2000)
    assert CanFrame.unpack(heard.pieces[-1]).id == 1999
    assert link.stats.received < 2000
    await link.close()


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("can:can0", "is not a bus; write it like can:socketcan:can0"),
        ("can:nothing:0", "python-can has no interface 'nothing'"),
        ("can:kvaser:0", "names no bit rate; write it like can:kvaser:0?bitrate=500000"),
        ("can:socketcan:can0?bitrate=500000", "is no option of socketcan; it takes data_bitrate"),
        ("can:socketcand:can0?host=h&data_bitrate=2000000", "is no option of socketcand"),
    ],
)
def test_a_wrong_bus_is_refused_with_how_it_is_written(url, expected):
    with pytest.raises(LinkRefused) as caught:
        parse_link_url(url)
    assert expected in str(caught.value)


async def test_a_missing_driver_is_said_in_words(receiver):
    with pytest.raises(LinkRefused, match=r"the driver for kvaser (is not installed|cannot be loaded)"):
        await open_link("can:kvaser:0?bitrate=500000", receiver())


# -- an adapter on it ------------------------------------------------------------------------------------


class BaseConfig(AdapterConfig):
    adapter: str = "base"
    link: str


class CanBase(FrameAdapter[BaseConfig]):
    """A base that takes a velocity in frame 111h and an emergency stop in 112h."""

    framing = DatagramFraming()
    repeat = 0.1

    def drive(self, velocity):
        yield CanFrame(0x111, round(velocity.linear.x * 1000).to_bytes(2, "big", signed=True)).packed()

    def halt(self):
        yield CanFrame(0x112, b"\x01").packed()

    def decode(self, frame, now):
        return ()


def speed(metres):
    return Velocity(Vector3(metres, 0.0, 0.0))


async def test_while_the_queue_is_full_only_the_newest_motion_waits_and_a_stop_overtakes_it(url, other):
    twin = "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"
    framed = FrameAdapterRunner(CanBase(BaseConfig(name="base", twin=twin, link=url)), RecordingRobot("base"))
    run = asyncio.create_task(serve(framed))
    await framed.robot.until(lambda: framed.robot.is_connected)
    bus = framed._slot._link._bus
    right = bus._bus.send
    bus._bus.send = full
    framed.drive(speed(0.1))  # lost: the queue is full
    for number in range(2, 50):
        framed.drive(speed(number / 100))
    assert framed.superseded >= 40
    bus._bus.send = right
    bus._full_at = 0.0
    framed._motion.poll()
    message = other.recv(WITHIN)
    assert (message.arbitration_id, bytes(message.data)) == (0x111, (490).to_bytes(2, "big"))
    bus._full_at = bus._clock.monotonic() + WITHIN  # full for as long as this test takes
    framed.drive(speed(0.9))  # waits
    framed.halt()
    bus._full_at = 0.0
    framed._motion.poll()
    assert other.recv(WITHIN).arbitration_id == 0x112
    assert other.recv(0.05) is None
    run.cancel()
    await asyncio.gather(run, return_exceptions=True)
