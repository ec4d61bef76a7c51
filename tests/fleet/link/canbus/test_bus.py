import errno
import os
import pty
import re
import socket
import tty
from pathlib import Path

import can
import pytest

from fleet.errors import LinkLost, LinkRefused
from fleet.link.canbus.bus import OpenCanBus, parse_bus
from fleet.link.canbus.frame import CanFrame
from fleet.testing.clock import ManualClock


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def pair(clock, request):
    """Return two ends of a virtual bus."""
    url = f"can:virtual:{request.node.name}"
    ends = [OpenCanBus(name, url, 1_000_000, clock) for name in "ab"]
    yield ends
    for end in ends:
        end.close()


def full(*_args, **_kwargs):
    raise can.CanOperationError("No buffer space available", error_code=errno.ENOBUFS)


def test_frames_cross_as_they_are(pair):
    one, other = pair
    frames = [CanFrame(0x181, b"\x01\x02"), CanFrame(0x18FF0102, bytes(8)), CanFrame(0x080, b"")]
    for frame in frames:
        one.send(frame)
    assert other.receive(1.0) == frames


def test_nothing_arrives_without_being_sent(pair):
    assert pair[0].receive(0.0) == []


def test_a_full_queue_drops_and_goes_on(pair, clock, monkeypatch):
    one, other = pair
    with monkeypatch.context() as broken:
        broken.setattr(one._bus, "send", full)
        one.send(CanFrame(1, b"old"))
    one.send(CanFrame(2, b"new"))
    assert one.dropped == 1
    assert other.receive(1.0) == [CanFrame(2, b"new")]


def test_a_queue_that_stays_full_is_a_dead_bus_and_nothing_old_is_sent(pair, clock, monkeypatch):
    one, other = pair
    with monkeypatch.context() as broken:
        broken.setattr(one._bus, "send", full)
        for _ in range(13):
            one.send(CanFrame(1, b"old"))
            clock.advance(0.01)
    one.send(CanFrame(2, b"new"))
    assert other.receive(0.0) == []
    with pytest.raises(LinkLost, match="no node acknowledges"):
        one.receive(0.0)


def test_a_bus_that_is_unplugged_is_reported(pair, monkeypatch):
    def gone(*_args):
        raise can.CanOperationError("No such device", error_code=errno.ENODEV)

    monkeypatch.setattr(pair[0]._bus, "recv", gone)
    with pytest.raises(LinkLost, match=r"bus 'a'.*reading failed: No such device"):
        pair[0].receive(0.0)


def test_bus_off_is_reported(pair, monkeypatch):
    error = can.Message(arbitration_id=0x40, is_error_frame=True)
    monkeypatch.setattr(pair[0]._bus, "recv", lambda _wait: error)
    with pytest.raises(LinkLost, match="bus-off"):
        pair[0].receive(0.0)
    assert pair[0].errors == 1


def test_a_closed_bus_is_reported(pair):
    pair[0].close()
    pair[0].close()
    pair[0].send(CanFrame(1, b""))
    with pytest.raises(LinkLost, match="it is closed"):
        pair[0].receive(0.0)


@pytest.mark.parametrize("text", ["can0", "can:socketcan", "can::can0", "can:nothing:can0", "socketcan:can0"])
def test_what_is_no_bus_is_refused(text):
    with pytest.raises(LinkRefused, match=text):
        parse_bus(text)


def test_a_multicast_bus_has_its_port():
    assert parse_bus("can:udp_multicast:239.74.163.2?port=43113")[:4] == (
        "udp_multicast",
        "239.74.163.2",
        43113,
        "",
    )


def test_frames_cross_a_serial_adapter_in_its_own_words(clock):
    adapter, device = pty.openpty()
    tty.setraw(device)
    bus = OpenCanBus("a", f"can:slcan:{os.ttyname(device)}", 1_000_000, clock)
    try:
        setup = b""
        while not setup.endswith(b"O\r"):
            setup += os.read(adapter, 64)
        bus.send(CanFrame(0x181, b"\x01\x02"))
        bus.send(CanFrame(0x18FF0102, b""))
        said = b""
        while said.count(b"\r") < 2:
            said += os.read(adapter, 64)
        assert said == b"t18120102\rT18FF01020\r"
        os.write(adapter, b"t0803AABBCC\r")
        assert bus.receive(5.0) == [CanFrame(0x080, b"\xaa\xbb\xcc")]
    finally:
        bus.close()
        os.close(adapter)
        os.close(device)


def listen(bus):
    """Read until the bus is lost."""
    while True:
        bus.receive(0.1)


def test_a_serial_adapter_that_is_pulled_out_is_a_lost_bus(clock):
    adapter, device = pty.openpty()
    bus = OpenCanBus("a", f"can:slcan:{os.ttyname(device)}", 1_000_000, clock)
    os.close(device)
    os.close(adapter)
    with pytest.raises(LinkLost, match="bus 'a'"):
        listen(bus)
    bus.close()


def test_without_the_kernels_can_the_bus_is_refused_and_with_it_frames_cross(clock):
    if not Path("/sys/class/net/vcan0").exists():
        with pytest.raises((LinkLost, LinkRefused), match="can:socketcan:vcan0"):
            OpenCanBus("a", "can:socketcan:vcan0", 1_000_000, clock)
        return
    one, other = (OpenCanBus(name, "can:socketcan:vcan0", 1_000_000, clock) for name in "ab")
    one.send(CanFrame(0x181, b"\x01"))
    assert other.receive(5.0) == [CanFrame(0x181, b"\x01")]
    one.close()
    other.close()


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("can:socketcand:can0", r"names no host; write it like can:socketcand:can0\?host="),
        (
            "can:socketcand:can0?host=pi&speed=1",
            r"'speed=1' is no option of socketcand; it takes host and port",
        ),
        ("can:socketcand:can0?host=pi&port=99999", r"there is no port 99999"),
        ("can:kvaser:0?host=pi", r"'host=pi' is no option of kvaser; it takes none"),
        ("can:socketcan:can0?port=1", r"'port=1' is no option of socketcan; it takes none"),
    ],
)
def test_options_that_an_interface_does_not_take_are_refused_in_words(url, expected):
    with pytest.raises(LinkRefused, match=expected):
        parse_bus(url)


def test_the_host_of_a_daemon_can_be_given():
    address = parse_bus("can:socketcand:can0?host=192.168.1.20&port=29537")
    assert (address.interface, address.channel, address.host, address.port) == (
        "socketcand",
        "can0",
        "192.168.1.20",
        29537,
    )


def test_a_daemon_that_does_not_answer_is_a_lost_link(clock):
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))  # and does not listen
        url = f"can:socketcand:can0?host=127.0.0.1&port={held.getsockname()[1]}"
        with pytest.raises(LinkLost, match="Connection refused"):
            OpenCanBus("a", url, 500_000, clock)


@pytest.mark.parametrize(
    "interface", sorted(can.VALID_INTERFACES - {"virtual", "udp_multicast", "socketcan"})
)
def test_whatever_python_can_raises_becomes_words(clock, interface):
    url = f"can:{interface}:0" + "?host=127.0.0.1&port=9" * (interface == "socketcand")
    with pytest.raises((LinkLost, LinkRefused), match=re.escape(url) + ": .+"):
        OpenCanBus("a", url, 500_000, clock)


def test_a_driver_that_is_not_installed_is_said_so(clock):
    with pytest.raises(LinkRefused, match=r"can:kvaser:0: the driver for kvaser is not installed on this"):
        OpenCanBus("a", "can:kvaser:0", 500_000, clock)
