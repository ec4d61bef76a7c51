"""The devices that a heartbeat is read from."""

import errno
import fcntl
import os
import pty
import termios

import pytest

from fleet.config.schema import StopInputConfig
from fleet.host.process import heartbeat_devices
from fleet.host.process.heartbeat_devices import (
    GET_LINE,
    HID_DESCRIPTOR_SIZE,
    LINE_REQUEST,
    PULSES,
    open_device,
)


def config(kind, device, **more):
    return StopInputConfig(name="button", kind=kind, device=str(device), **more)


@pytest.fixture
def line():
    master, slave = pty.openpty()
    yield master, os.ttyname(slave)
    os.close(slave)
    os.close(master)


def test_a_serial_line_is_read_raw_at_its_speed_and_what_waited_is_thrown_away(line):
    master, name = line
    os.write(master, b"old")
    device = open_device(config("serial", name, baud=19200))
    try:
        assert termios.tcgetattr(device)[4] == termios.B19200
        with pytest.raises(BlockingIOError):
            os.read(device, 10)
        os.write(master, b"\x03\x04")
        assert os.read(device, 10) == b"\x03\x04"
    finally:
        os.close(device)


def test_what_is_no_serial_line_is_refused(tmp_path):
    (tmp_path / "file").write_bytes(b"x")
    with pytest.raises(OSError, match="this is not a serial device"):
        open_device(config("serial", tmp_path / "file"))
    with pytest.raises(FileNotFoundError):
        open_device(config("serial", tmp_path / "none"))


def test_a_gpio_line_is_asked_for_its_rising_edges_and_pulled_down(tmp_path, monkeypatch):
    (tmp_path / "gpiochip0").touch()
    reader, writer = os.pipe()
    requested = []

    def ioctl(_chip, request, argument):
        requested.append((request, LINE_REQUEST.unpack(argument)))
        argument[-4:] = reader.to_bytes(4, "little")
        return 0

    monkeypatch.setattr(heartbeat_devices.fcntl, "ioctl", ioctl)
    device = open_device(config("gpio", tmp_path / "gpiochip0", line=17))
    ((request, fields),) = requested
    assert (request, fields[0], fields[1:64], fields[65]) == (GET_LINE, 17, (0,) * 63, PULSES)
    assert fields[67] == 1
    with pytest.raises(BlockingIOError):
        os.read(device, 10)
    os.close(writer)
    os.close(device)


def test_the_request_for_a_line_has_the_size_that_the_kernel_expects():
    assert LINE_REQUEST.size == GET_LINE >> 16 & 0x3FFF == 592


@pytest.mark.parametrize("kind", ["gpio", "hid"])
def test_a_file_that_is_another_device_is_refused(tmp_path, kind):
    (tmp_path / "file").touch()
    more = {"line": 1} if kind == "gpio" else {}
    with pytest.raises(OSError) as refusal:
        open_device(config(kind, tmp_path / "file", **more))
    assert refusal.value.errno == errno.ENOTTY


def test_a_hid_device_is_known_by_its_descriptor(tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "hidraw0")
    requested = []
    monkeypatch.setattr(fcntl, "ioctl", lambda _fd, request, _size: requested.append(request))
    device = open_device(config("hid", tmp_path / "hidraw0"))
    assert requested == [HID_DESCRIPTOR_SIZE]
    os.close(device)
