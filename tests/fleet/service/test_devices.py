"""Which devices of a fleet file a service may open, and how udev gives them to it."""

import pytest

from fleet.config.load import load
from fleet.service.devices import Devices, devices_of, named_in, udev_rules, unsafe_names

FILE = """\
edge: {id: yard-1}
remote_workers: [far]
stop_inputs:
  - {name: button, kind: gpio, device: /dev/gpiochip0, line: 4}
robots:
  - name: kestrel
    twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11
    adapter: mavlink
    link: serial:/dev/serial/by-id/usb-Holybro-if00?baud=57600
    system_id: 1
  - name: merlin
    twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c12
    adapter: mavlink
    link: udpin:0.0.0.0:14550
    system_id: 2
  - name: far-one
    twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c13
    adapter: mavlink
    link: serial:/dev/ttyS9?baud=57600
    system_id: 3
    worker: far
"""


def test_links_and_stop_inputs_name_devices_and_robots_of_other_computers_do_not(tmp_path):
    (tmp_path / "fleet.yaml").write_text(FILE)
    found = devices_of(load(tmp_path / "fleet.yaml"))
    assert found == Devices(("/dev/gpiochip0", "/dev/serial/by-id/usb-Holybro-if00"))


@pytest.mark.parametrize(
    ("text", "files", "interfaces"),
    [
        ("serial:/dev/ttyUSB0?baud=115200", ("/dev/ttyUSB0",), ()),
        ("can:slcan:/dev/ttyACM0?bitrate=500000", ("/dev/ttyACM0",), ()),
        ("v4l2:/dev/video0", ("/dev/video0",), ()),
        ("can:socketcan:can0", (), ("can0",)),
        ("can:socketcan:can1?data_bitrate=2000000", (), ("can1",)),
        ("can:kvaser:0?bitrate=500000", (), ()),
        ("udpout:192.168.1.10:14550", (), ()),
        ("sim:px4", (), ()),
        ("https://camera/dev/video0", (), ()),
    ],
)
def test_a_link_names_the_device_that_it_opens(text, files, interfaces):
    assert named_in([text]) == Devices(files, interfaces)


@pytest.mark.parametrize(
    ("file", "classes"),
    [
        ("/dev/ttyUSB1", ("char-ttyUSB",)),
        ("/dev/ttyAMA0", ("char-ttyAMA",)),
        ("/dev/ttyS0", ("char-ttyS",)),
        ("/dev/hidraw2", ("char-hidraw",)),
        ("/dev/serial/by-id/usb-x", ("char-ttyACM", "char-ttyUSB")),
        ("/dev/rover", ("char-ttyACM", "char-ttyUSB")),
    ],
)
def test_the_class_of_a_device_is_allowed_so_that_it_may_be_plugged_in_again(file, classes):
    assert Devices((file,)).classes == classes


def test_udev_gives_the_named_device_to_the_group_and_no_other():
    rules = udev_rules(Devices(("/dev/serial/by-id/usb-x", "/dev/ttyS0"), ("can0",)), "fleet")
    assert rules.splitlines() == [
        'SYMLINK=="serial/by-id/usb-x", GROUP="fleet", MODE="0660"',
        'SYMLINK=="ttyS0", GROUP="fleet", MODE="0660"',
        'KERNEL=="ttyS0", GROUP="fleet", MODE="0660"',
        'SUBSYSTEM=="net", ACTION=="add", KERNEL=="can0", ATTR{tx_queue_len}="16"',
    ]


def test_a_name_that_would_widen_a_rule_is_found():
    assert unsafe_names(Devices(("/dev/tty*", '/dev/x",MODE="0666', "/dev/ttyS0"))) == [
        "/dev/tty*",
        '/dev/x",MODE="0666',
    ]
