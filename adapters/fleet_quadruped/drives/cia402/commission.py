"""Configures CiA 402 drives with ``canopen`` (SDO and NMT), all at once, and reads everything back."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import canopen
from canopen.objectdictionary import ObjectDictionary
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from fleet.errors import LinkLost, LinkRefused
from fleet_quadruped.can.frame import CanBus, Frame
from fleet_quadruped.drives.cia402.setup import (
    CYCLIC_POSITION,
    DEVICE_TYPE,
    MODE_DISPLAY,
    MODES,
    PROFILE_402,
    Object,
    all_objects,
    final_values,
)
from fleet_quadruped.robot.description import Joint
from fleet_quadruped.robot.parts import Drive

log = logging.getLogger(__name__)

_MODE_TRIES = 20  # times the mode display is read
_READ_ONLY = 0x06010002
_NO_OBJECT = 0x06020000
_ABORTS = {
    0x05040000: "the drive did not go on with the transfer",
    0x06010002: "it is read-only",
    0x06020000: "the drive has no such object",
    0x06040041: "it cannot be mapped to a PDO",
    0x06040042: "the mapped objects are longer than the PDO",
    0x06090011: "the drive has no such subindex",
    0x06090030: "the value is out of the drive's range",
    0x08000022: "not in this state of the drive",
}


class Wire(canopen.Network):
    """``canopen`` over a bus of ours: what it sends goes out, what a pump reads comes in."""

    def __init__(self, bus: CanBus) -> None:
        super().__init__()
        self._out = bus
        self._sending = threading.Lock()

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:  # noqa: ARG002, FBT001, FBT002
        """Send a frame for canopen."""
        with self._sending:
            self._out.send(Frame(can_id, bytes(data)))

    @contextlib.contextmanager
    def pumped(self) -> Iterator[None]:
        """Read the bus on a thread while the block runs."""
        done = threading.Event()

        def pump() -> None:
            while not done.is_set():
                for frame in self._out.receive(0.02):
                    self.notify(frame.id, bytearray(frame.data), 0.0)

        thread = threading.Thread(target=pump, name=f"sdo:{self._out.name}", daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()


def commission(bus: CanBus, joints: Sequence[Joint], drive: Drive) -> None:
    """Configure the drives of one bus and start them (NMT operational).

    Raises LinkLost when a drive does not answer, LinkRefused naming joint, object, wanted and actual.
    """
    wire = Wire(bus)
    dictionary = _dictionary(drive)
    with wire.pumped(), ThreadPoolExecutor(len(joints), thread_name_prefix="sdo") as pool:
        nodes = [(joint, wire.add_node(canopen.RemoteNode(joint.id, dictionary))) for joint in joints]
        for outcome in [pool.submit(_configure, node, joint, drive) for joint, node in nodes]:
            outcome.result()
        for _, node in nodes:
            node.nmt.send_command(0x01)


def _dictionary(drive: Drive) -> ObjectDictionary:
    """Return the drive's EDS; raises LinkRefused when an object that is needed is not in it."""
    if not drive.eds:
        return canopen.ObjectDictionary()  # type: ignore[no-untyped-call]
    try:
        dictionary = canopen.import_od(drive.eds)
    except (OSError, ValueError, KeyError) as error:
        raise LinkRefused(f"drive.eds: {drive.eds} cannot be read: {error}") from None
    lacking = {item.place for item in all_objects(drive, 1)} - set(dictionary)
    if lacking:
        names = ", ".join(f"{index:04X}h" for index in sorted(lacking))
        raise LinkRefused(f"drive.eds: {drive.eds} has no {names}: this drive cannot be used")
    return dictionary


def _configure(node: canopen.RemoteNode, joint: Joint, drive: Drive) -> None:
    """Configure one drive in pre-operational, where mappings may be changed."""
    node.nmt.send_command(0x80)
    _identify(node, joint, drive)
    objects = all_objects(drive, joint.id)
    for item in objects:
        _write(node, joint, item)
    for item in final_values(objects):
        actual = _read(node, joint, item.place, item.sub)
        if actual != item.value:
            raise LinkRefused(
                f"{joint.name}: {item.name} ({item.what}) is {actual:#x}, wanted {item.value:#x}"
            )

    _await_mode(node, joint)


def _await_mode(node: canopen.RemoteNode, joint: Joint) -> None:
    """Wait until the drive shows the mode that it was given; raises LinkRefused when it does not."""
    for _ in range(_MODE_TRIES):
        shown = _read(node, joint, *MODE_DISPLAY)
        if shown == CYCLIC_POSITION:
            return
    raise LinkRefused(
        f"{joint.name}: 6061h:0 (mode shown) is {shown}, wanted {CYCLIC_POSITION}: it does not take the mode"
    )


def _identify(node: canopen.RemoteNode, joint: Joint, drive: Drive) -> None:
    """Refuse a device that is not the drive that the description means."""
    kind = _read(node, joint, *DEVICE_TYPE) & 0xFFFF
    if kind != PROFILE_402:
        raise LinkRefused(
            f"{joint.name}: 1000h:0 says profile {kind}, wanted 402: another device has id {joint.id}"
        )
    for sub, wanted in ((1, drive.vendor), (2, drive.product)):
        if wanted is not None and (actual := _read(node, joint, 0x1018, sub)) != wanted:
            raise LinkRefused(
                f"{joint.name}: 1018h:{sub} is {actual:#x}, wanted {wanted:#x}: another make of drive"
            )
    modes = _read(node, joint, *MODES)
    if not modes >> (CYCLIC_POSITION - 1) & 1:
        raise LinkRefused(f"{joint.name}: 6502h:0 is {modes:#x}: it has no cyclic synchronous position mode")


def _write(node: canopen.RemoteNode, joint: Joint, item: Object) -> None:
    """Write an object; what is read-only is left to the reading back."""
    try:
        node.sdo.download(item.place, item.sub, item.value.to_bytes(item.size, "little"))
    except SdoAbortedError as error:
        if error.code != _READ_ONLY:
            raise _refused(joint, item.name, item.what, error) from None
        log.info("%s: %s is read-only", joint.name, item.name)
    except SdoCommunicationError:
        raise _silent(joint) from None


def _read(node: canopen.RemoteNode, joint: Joint, index: int, sub: int) -> int:
    """Return an object as an unsigned number."""
    try:
        return int.from_bytes(node.sdo.upload(index, sub), "little")
    except SdoAbortedError as error:
        raise _refused(joint, f"{index:04X}h:{sub}", "to be read", error) from None
    except SdoCommunicationError:
        raise _silent(joint) from None


def _refused(joint: Joint, name: str, what: str, error: SdoAbortedError) -> LinkRefused:
    why = _ABORTS.get(error.code, "the drive refused it")
    return LinkRefused(f"{joint.name}: {name} ({what}): {why} (SDO abort {error.code:08X}h)")


def _silent(joint: Joint) -> LinkLost:
    return LinkLost(
        f"{joint.name}: id {joint.id} on bus {joint.bus!r} does not answer; check power, wiring, id, bitrate"
    )
