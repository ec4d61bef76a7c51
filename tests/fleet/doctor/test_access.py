"""Rights that are missing or too wide, devices that are gone, held or shut, and CAN interfaces."""

import os
import pty
import stat
from pathlib import Path

import pytest

from fleet.doctor.access import (
    READ,
    Account,
    account,
    check_can,
    check_devices,
    check_plugins,
    check_readable,
    check_state_folder,
    holders_of_devices,
)
from fleet.doctor.finding import Rating
from fleet.service.devices import Devices

STRANGER = Account("stranger", 54_321, frozenset({54_321}))


def owner_of(path):
    found = path.stat()
    return Account("me", found.st_uid or 1, frozenset({found.st_gid}))


def result(mode, user=1000, group=1000):
    return os.stat_result((mode, 0, 0, 0, user, group, 0, 0, 0, 0))


@pytest.mark.parametrize(
    ("mode", "user", "group", "may"),
    [
        (0o600, 54_321, 1, True),
        (0o060, 54_321, 54_321, False),  # the owner's rights count, also where the group has more
        (0o060, 1, 54_321, True),
        (0o604, 1, 1, True),
        (0o660, 1, 1, False),
    ],
)
def test_the_rights_of_owner_group_and_others_decide_in_this_order(mode, user, group, may):
    assert STRANGER.may(result(mode, user, group), READ) is may


def test_root_may_everything():
    assert Account("root", 0, frozenset()).may(result(0o000), READ)


def test_a_state_folder_of_another_user_is_an_error(tmp_path):
    tmp_path.chmod(0o700)
    found = check_state_folder(tmp_path, STRANGER)
    assert (found.verdict, found.cure) == (Rating.ERROR, f"chown -R stranger {tmp_path}")


def test_a_state_folder_that_others_may_read_is_a_warning(tmp_path):
    tmp_path.chmod(0o755)
    who = Account("me", tmp_path.stat().st_uid, frozenset())
    assert check_state_folder(tmp_path, who).cure == f"chmod 700 {tmp_path}"
    tmp_path.chmod(0o700)
    assert check_state_folder(tmp_path, who).verdict is Rating.OK
    assert check_state_folder(tmp_path / "none", who).verdict is Rating.OK


def test_a_fleet_file_that_the_user_cannot_read_is_an_error(tmp_path):
    (tmp_path / "secrets.yaml").touch(mode=0o600)
    (found,) = check_readable([tmp_path / "secrets.yaml"], STRANGER)
    assert (found.verdict, "stranger cannot read" in found.found) == (Rating.ERROR, True)
    (missing,) = check_readable([tmp_path / "gone.yaml"], STRANGER)
    assert missing.verdict is Rating.ERROR
    (fine,) = check_readable([], STRANGER)
    assert fine.verdict is Rating.OK


def test_drop_ins_that_others_may_write_are_an_error(tmp_path):
    (tmp_path / "rover.py").touch()
    tmp_path.chmod(0o755)
    (tmp_path / "rover.py").chmod(0o666)
    (found,) = check_plugins([tmp_path])
    assert found.cure == f"chmod go-w {tmp_path / 'rover.py'}"


def device(path):
    (found,) = check_devices(Devices((str(path),)), STRANGER, {})
    return found


def test_a_device_that_is_not_plugged_in_is_an_error():
    assert (device("/dev/no-such").verdict, "plug it in" in device("/dev/no-such").cure) == (
        Rating.ERROR,
        True,
    )


def test_a_file_in_the_place_of_a_device_is_an_error(tmp_path):
    (tmp_path / "ttyUSB0").touch()
    assert "is no device" in device(tmp_path / "ttyUSB0").found


@pytest.fixture
def line():
    """Open a pseudo-terminal in the place of a serial line."""
    ours, theirs = pty.openpty()
    yield Path(os.ttyname(theirs))
    os.close(ours)
    os.close(theirs)


def test_a_device_that_the_user_may_not_open_is_reported_with_its_group(line):
    line.chmod(0o600)
    found = device(line)
    assert (found.verdict, "usermod -aG" in found.cure) == (Rating.ERROR, True)


def test_a_device_that_another_program_holds_is_reported_with_its_name(line):
    number = line.stat().st_rdev
    (found,) = check_devices(Devices((str(line),)), account("root"), {number: "minicom (process 7)"})
    assert (found.verdict, "minicom (process 7)" in found.found) == (Rating.WARNING, True)
    (free,) = check_devices(Devices((str(line),)), account("root"), {})
    assert free.verdict is Rating.OK


def test_programs_that_hold_a_device_are_found_by_its_number(line):
    assert f"(process {os.getpid()})" in holders_of_devices()[line.stat().st_rdev]


def test_no_device_is_opened(line, monkeypatch):
    monkeypatch.setattr(os, "open", lambda *_: pytest.fail("opened"))
    assert stat.S_ISCHR(line.stat().st_mode)
    device(line)


def interface(folder, *, flags="0x1", queue="10"):
    (folder / "can0").mkdir()
    (folder / "can0" / "flags").write_text(f"{flags}\n")
    (folder / "can0" / "tx_queue_len").write_text(f"{queue}\n")
    (found,) = check_can(Devices(interfaces=("can0",)), folder)
    return found


def test_a_can_interface_that_is_missing_down_or_queues_too_much_is_reported(tmp_path):
    (missing,) = check_can(Devices(interfaces=("can0",)), tmp_path)
    assert (missing.verdict, "no interface can0" in missing.found) == (Rating.ERROR, True)
    places = [tmp_path / name for name in "abc"]
    for place in places:
        place.mkdir()
    assert interface(places[0], flags="0x40080").found == "can0 is down"
    assert interface(places[1], queue="1000").cure == "ip link set can0 txqueuelen 16"
    assert interface(places[2]).verdict is Rating.OK
