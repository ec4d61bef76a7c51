"""The kernel's own frames, on a pair of datagram sockets that stand for a CAN socket."""

import socket

import can
import pytest
from can.interfaces.socketcan.socketcan import build_can_frame, dissect_can_frame
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import LinkLost
from fleet.link.canbus import bus as buses
from fleet.link.canbus import raw
from fleet.link.canbus.bus import OpenCanBus
from fleet.link.canbus.frame import CanFrame
from fleet.testing.clock import ManualClock

frames = st.builds(CanFrame, st.integers(0, 0x1FFFFFFF), st.binary(max_size=8))


@pytest.fixture
def wire(monkeypatch):
    """Return a Bus on one end of a pair of sockets, and the other end."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    monkeypatch.setattr(buses, "_socket_of", lambda _: ours)
    bus = OpenCanBus("a", "can:virtual:raw", 1_000_000, ManualClock())
    yield bus, theirs
    bus.close()
    ours.close()
    theirs.close()


@given(frames)
def test_a_frame_is_packed_as_python_can_does_it(frame):
    message = can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=frame.id > 0x7FF)
    ours, theirs = raw.pack(frame), build_can_frame(message)
    assert (ours[:5], ours[8:]) == (theirs[:5], theirs[8:])  # the others are padding and an 8 byte code
    assert dissect_can_frame(raw.pack(frame))[3] == frame.data


@given(frames)
def test_a_frame_comes_back_as_it_was(frame):
    assert raw.unpack(raw.pack(frame)) == (frame, False, False)


def test_an_extended_frame_with_the_number_of_a_drive_is_not_the_drives(wire):
    bus, theirs = wire
    theirs.send(build_can_frame(can.Message(arbitration_id=0x181, data=bytes(8), is_extended_id=True)))
    theirs.send(raw.pack(CanFrame(0x182, b"")))
    assert bus.receive(0.1) == [CanFrame(0x182, b"")]


def test_nor_is_it_by_python_cans_own_way():
    ours = OpenCanBus("a", "can:virtual:foreign", 1_000_000, ManualClock())
    with can.Bus(interface="virtual", channel="foreign") as other:
        other.send(can.Message(arbitration_id=0x181, data=bytes(8), is_extended_id=True))
        other.send(can.Message(arbitration_id=0x182, is_extended_id=False))
        assert ours.receive(0.1) == [CanFrame(0x182, b"")]
    ours.close()


def test_golden_bytes():
    assert raw.pack(CanFrame(0x201, b"\x0f\x00")).hex() == "01020000020000000f00000000000000"
    assert raw.pack(CanFrame(0x18FF0102, b"")).hex() == "0201ff98000000000000000000000000"


@pytest.mark.parametrize(
    "frame",
    [
        CanFrame(0x8001, bytes(range(48)), fd=True),
        CanFrame(0x7FF, b"", fd=True),
        CanFrame(0x021, b"", remote=True),
    ],
)
def test_fd_and_remote_frames_are_those_of_the_kernel(frame):
    message = can.Message(
        arbitration_id=frame.id,
        data=frame.data,
        is_extended_id=frame.extended,
        is_fd=frame.fd,
        bitrate_switch=frame.fd,
        is_remote_frame=frame.remote,
    )
    ours, theirs = raw.pack(frame), build_can_frame(message)
    assert ours[:7] + ours[8:] == theirs[:7] + theirs[8:]  # byte 7 is nobody's in CAN FD
    packet = raw.unpack(raw.pack(frame))
    assert packet.unwanted == frame.remote  # others may ask each other; we do not answer
    assert frame.remote or packet.frame == frame


@given(st.binary(max_size=80))
def test_whatever_the_kernel_gives_is_read(data):
    raw.unpack(data)


def test_a_bus_reads_and_writes_without_python_can(wire):
    bus, other = wire
    bus.send(CanFrame(0x201, b"target"))
    assert raw.unpack(other.recv(72)).frame == CanFrame(0x201, b"target")
    for number in range(3):
        other.send(raw.pack(CanFrame(0x181 + number, b"told")))
    assert [frame.id for frame in bus.receive(1.0)] == [0x181, 0x182, 0x183]
    assert bus.receive(0.0) == []


def test_errors_are_counted_and_bus_off_is_the_end(wire):
    bus, other = wire
    other.send(bytes.fromhex("04000020080000000000000000000000"))
    other.send(bytes.fromhex("01020040000000000000000000000000"))
    assert bus.receive(0.0) == []
    assert bus.errors == 1
    other.send(bytes.fromhex("40000020080000000000000000000000"))
    with pytest.raises(LinkLost, match="bus-off"):
        bus.receive(0.0)


def test_a_queue_that_is_full_drops_the_frame(wire):
    bus, _ = wire
    for _ in range(10_000):
        bus.send(CanFrame(0x201, b"12345678"))
        if bus.dropped:
            break
    assert bus.dropped == 1
