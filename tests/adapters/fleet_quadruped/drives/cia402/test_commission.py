"""How CiA 402 drives are configured by SDO: identified, written, read back, started, or refused in words."""

import re
from types import SimpleNamespace

import pytest
from canopen.sdo.client import SdoClient

from fleet import CanFrame
from fleet.errors import LinkLost, LinkRefused
from fleet_quadruped.drives.cia402.commission import NodeName, commission, limit_drive, write_node
from fleet_quadruped.drives.cia402.frames import OPERATIONAL, SDO_REQUEST
from fleet_quadruped.drives.cia402.setup import (
    ERROR_BEHAVIOUR,
    TORQUE,
    TORQUE_OFFSET,
    Object,
    all_objects,
    final_values,
)
from fleet_quadruped.sim.cia402 import SimDrive
from fleet_quadruped.sim.lockstep import SimBus
from fleet_quadruped.sim.sdo import SdoServer
from fleet_quadruped.sim.world import SimMotor

READ_ONLY, TIMEOUT_0 = 0x06010002, (0x1016, 1)
START, PRE_OPERATIONAL = 0x01, 0x80


class Bench:
    """The first drives of a dog on a bus; ``lost``: how many frames to them are lost from now on.

    ``commands``: the NMT commands that were sent, as (command, node).
    """

    def __init__(self, dog, count=1):
        self.bus, self.joints, self.drive = SimBus("a"), dog.all_joints[:count], dog.drive
        self.drives = [SimDrive(joint, SimMotor(), self.bus.arrive, dog.drive) for joint in self.joints]
        self.lost, self.commands = 0, []
        self.bus.connect(self)

    def handle_frame(self, bus, frame):
        if frame.id == 0x000:
            self.commands.append(tuple(frame.data))
        elif self.lost:
            self.lost -= 1
            return
        for drive in self.drives:
            if frame.id in drive.hears:
                drive.hears[frame.id](frame)

    @property
    def sdo(self):
        return self.drives[0].sdo

    def configure(self, **changes):
        return commission(self.bus, self.joints, self.drive.model_copy(update=changes))

    def refused(self, **changes):
        with pytest.raises(LinkRefused) as caught:
            self.configure(**changes)
        return str(caught.value)


@pytest.fixture
def bench(dog):
    return Bench(dog)


@pytest.fixture(autouse=True)
def quickly_silent(monkeypatch):
    monkeypatch.setattr(SdoClient, "RESPONSE_TIMEOUT", 0.02)


def test_each_object_has_its_value_before_the_drives_are_started(dog):
    bench = Bench(dog, 2)
    assert bench.configure() == {"FL_abad": frozenset(), "FL_hip": frozenset()}
    for joint, drive in zip(bench.joints, bench.drives, strict=True):
        for item in final_values(all_objects(bench.drive, joint.id)):
            assert drive.sdo.objects[item.place, item.sub].value == item.value, item
        assert drive.nmt == OPERATIONAL
    assert sorted(bench.commands[:2]) == [(PRE_OPERATIONAL, 1), (PRE_OPERATIONAL, 2)]
    assert bench.commands[2:] == [(START, 1), (START, 2)]


def test_what_a_drive_lacks_is_returned_and_not_written(bench):
    bench.sdo.be_plain()
    bench.sdo.be_simple()
    assert bench.configure() == {"FL_abad": frozenset({TORQUE_OFFSET, TORQUE, ERROR_BEHAVIOUR})}
    assert bench.sdo.objects[0x1600, 0].value == 2


def test_none_is_started_while_one_is_refused(dog):
    bench = Bench(dog, 2)
    bench.drives[1].pretend()
    assert bench.refused() == "FL_hip: 1000h:0 says profile 401, wanted 402: another device has id 2"
    assert START not in {command for command, _ in bench.commands}


@pytest.mark.parametrize(
    ("place", "value", "wanted", "expected"),
    [
        ((0x1018, 1), 0x22, {"vendor": 0x11}, "1018h:1 is 0x22, wanted 0x11: another make of drive"),
        ((0x1018, 2), 0x22, {"product": 0x11}, "1018h:2 is 0x22, wanted 0x11: another make of drive"),
        ((0x6502, 0), 0x7F, {}, "6502h:0 is 0x7f: it has no cyclic synchronous position mode"),
    ],
)
def test_a_drive_of_another_make_is_refused(bench, place, value, wanted, expected):
    bench.sdo.objects[place].value = value
    assert bench.refused(**wanted) == f"FL_abad: {expected}"


def test_the_make_is_compared_only_where_the_description_has_it(bench):
    bench.sdo.objects[0x1018, 1].value = 0x11
    bench.configure(vendor=0x11, product=None)


def test_a_drive_that_does_not_take_its_mode_is_refused(bench):
    bench.sdo.keep_mode()
    assert bench.refused().startswith("FL_abad: 6061h:0 (mode shown) is 1, wanted 8")


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        (0x06090030, "the value is out of the drive's range"),
        (0x08000022, "not in this state of the drive"),
        (0x06040041, "it cannot be mapped to a PDO"),
        (0x06040042, "the mapped objects are longer than the PDO"),
        (0x08000000, "the drive refused it"),
    ],
)
def test_a_refused_object_is_named_with_the_reason_in_words(bench, code, expected):
    bench.sdo.refusals[TIMEOUT_0] = code
    what = "1016h:1 (time until our silence stops the drive)"
    assert bench.refused() == f"FL_abad: {what}: {expected} (SDO abort {code:08X}h)"


def test_a_read_only_object_may_stay_as_it_is_if_its_value_is_the_wanted_one(bench):
    bench.sdo.refusals[TIMEOUT_0] = READ_ONLY
    assert bench.refused().endswith("is 0x0, wanted 0x7f0064")
    bench.sdo.objects[TIMEOUT_0].value = 0x7F0064
    bench.configure()


def test_a_value_that_does_not_stay_is_refused(bench):
    class Forgetful:
        size = 2
        value = property(lambda self: 0, lambda self, value: None)

    bench.sdo.objects[0x6007, 0] = Forgetful()
    assert bench.refused() == (
        "FL_abad: 6007h:0 (quick stop when our heartbeat is missing) is 0x0, wanted 0x3"
    )


@pytest.mark.parametrize("lost", [1, 2])
def test_a_lost_request_is_repeated(bench, lost):
    bench.lost = lost
    bench.configure()


def test_a_drive_that_does_not_answer_three_times_is_lost(bench):
    bench.lost = 99
    with pytest.raises(LinkLost, match=r"^FL_abad: id 1 on bus 'a' does not answer; check power, wiring, id"):
        bench.configure()
    assert [frame.id for frame in bench.bus.sent if frame.data[0] == 0x40] == [SDO_REQUEST + 1] * 3


def eds(*indices):
    """Return a data sheet with these objects."""
    lines = ["[FileInfo]\nFileName=x.eds\n[DeviceInfo]\nVendorName=x"]
    lines += [
        f"[{index:04X}]\nParameterName=x\nObjectType=0x7\nDataType=0x0007\nAccessType=rw" for index in indices
    ]
    return "\n".join(lines)


def test_a_data_sheet_without_a_needed_object_is_refused_before_anything_is_sent(bench, tmp_path):
    places = {item.place for item in all_objects(bench.drive, 1)} - {0x1029, 0x60B2, 0x6077}
    path = tmp_path / "x.eds"
    path.write_text(eds(*(places - {0x605A, 0x6007})))
    assert bench.refused(eds=str(path)) == (
        f"drive.eds: {path} has no 6007h, 605Ah: this drive cannot be used"
    )
    assert not bench.bus.sent
    path.write_text(eds(*places))
    bench.configure(eds=str(path))


def test_a_data_sheet_that_cannot_be_read_is_named(bench, tmp_path):
    assert bench.refused(eds=f"{tmp_path}/none.eds").startswith(
        f"drive.eds: {tmp_path}/none.eds cannot be read"
    )


def test_the_torque_of_a_drive_is_limited_and_the_former_limit_returned(bench):
    bench.sdo.objects[0x6072, 0].value = 1200
    assert limit_drive(bench.bus, bench.joints[0], 300) == 1200
    assert bench.sdo.objects[0x6072, 0].value == 300
    assert bench.commands == []  # it is neither stopped nor started


def test_a_drive_without_a_torque_limit_is_refused(bench):
    del bench.sdo.objects[0x6072, 0]
    with pytest.raises(LinkRefused) as caught:
        limit_drive(bench.bus, bench.joints[0], 300)
    assert str(caught.value) == (
        "FL_abad: 6072h:0 (to be read): the drive has no such object (SDO abort 06020000h)"
    )


def test_a_node_of_any_profile_is_written_while_it_is_pre_operational():
    bus, objects = SimBus("a"), [Object(0x2000, 0, 2, 7, "seven")]
    server = SdoServer(9, {(0x2000, 0): (2, 0)}, bus.arrive)
    bus.connect(SimpleNamespace(handle_frame=lambda name, frame: server.handle_frame(frame)))
    write_node(bus, NodeName("mule", "a", 9), objects)
    assert server.objects[0x2000, 0].value == 7
    first, *_, last = bus.sent
    assert (first, last) == (CanFrame(0, bytes([PRE_OPERATIONAL, 9])), CanFrame(0, bytes([START, 9])))
    server.refusals[0x2000, 0] = 0x06020000
    with pytest.raises(LinkRefused, match=re.escape("mule: 2000h:0 (seven): the drive has no such object")):
        write_node(bus, NodeName("mule", "a", 9), objects)
    assert bus.sent[-1].id == SDO_REQUEST + 9
