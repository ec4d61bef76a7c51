"""Configuration of CiA 402 drives by SDO and NMT (``canopen``), all at once, verified by reading back."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, TypeVar

import canopen
from canopen.objectdictionary import ObjectDictionary
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from fleet import CanBus, CanFrame, LinkLost, LinkRefused
from fleet_quadruped.drives.cia402.setup import (
    CYCLIC_POSITION,
    DEVICE_TYPE,
    MAX_TORQUE,
    MODE_DISPLAY,
    MODES,
    OPTIONAL,
    PROFILE_402,
    Object,
    all_objects,
    final_values,
)
from fleet_quadruped.robot.joint import Joint
from fleet_quadruped.robot.parts import Drive

TransferredT = TypeVar("TransferredT")
log = logging.getLogger(__name__)

_MODE_TRIES = 20  # reads of the mode display
_TRIES = 3  # a lost frame, or a busy computer, is no silent drive
_READ_ONLY = 0x06010002
_NO_OBJECT = 0x06020000
_NO_SUB = 0x06090011
_ABORTS = {
    0x05040000: "the drive did not continue the transfer",
    _READ_ONLY: "it is read-only",
    _NO_OBJECT: "the drive has no such object",
    0x06040041: "it cannot be mapped to a PDO",
    0x06040042: "the mapped objects are longer than the PDO",
    _NO_SUB: "the drive has no such subindex",
    0x06090030: "the value is out of the drive's range",
    0x08000022: "not in this state of the drive",
}


class NodeName(NamedTuple):
    """Name, bus and node id of a node, for error messages."""

    name: str
    bus: str
    id: int


class CanopenAdapter(canopen.Network):
    """``canopen`` over a bus of ours: its frames are sent on it, a pump thread passes on received ones."""

    def __init__(self, bus: CanBus) -> None:
        super().__init__()
        self._out = bus
        self._sending = threading.Lock()

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:  # noqa: ARG002, FBT001, FBT002
        """Send a frame for canopen."""
        with self._sending:
            self._out.send(CanFrame(can_id, bytes(data)))

    @contextlib.contextmanager
    def pumped(self) -> Iterator[None]:
        """Read the bus on a thread for the duration of the block."""
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


def commission(bus: CanBus, joints: Sequence[Joint], drive: Drive) -> dict[str, frozenset[int]]:
    """Configure the drives of one bus and start them (NMT operational).

    Return, by joint, the ``OPTIONAL`` entries that its drive lacks. Raises LinkLost if a drive does not
    answer, LinkRefused with joint, object, expected and actual value.
    """
    wire = CanopenAdapter(bus)
    dictionary = _dictionary(drive)
    with wire.pumped(), ThreadPoolExecutor(len(joints), thread_name_prefix="sdo") as pool:
        nodes = [(joint, wire.add_node(canopen.RemoteNode(joint.id, dictionary))) for joint in joints]
        under_way = {joint.name: pool.submit(_configure, node, joint, drive) for joint, node in nodes}
        missing = {name: outcome.result() for name, outcome in under_way.items()}
        for _, node in nodes:
            node.nmt.send_command(0x01)
    return missing


def write_node(bus: CanBus, who: NodeName, objects: list[Object]) -> None:
    """Configure one node of any profile and start it; raises LinkLost or LinkRefused, see ``commission``."""
    wire = CanopenAdapter(bus)
    with wire.pumped():
        node = wire.add_node(canopen.RemoteNode(who.id, canopen.ObjectDictionary()))  # type: ignore[no-untyped-call]
        node.nmt.send_command(0x80)
        write_all(node, who, objects)
        node.nmt.send_command(0x01)


def limit_drive(bus: CanBus, joint: Joint, per_mille: int) -> int:
    """Set a drive's maximum torque (6072h, per mille of rated torque); return the previous one.

    Raises LinkLost or LinkRefused.
    """
    wire, who = CanopenAdapter(bus), _who(joint)
    limit = Object(*MAX_TORQUE, 2, per_mille, "highest torque, per mille of the rated one")
    with wire.pumped():
        node = wire.add_node(canopen.RemoteNode(who.id, canopen.ObjectDictionary()))  # type: ignore[no-untyped-call]
        before = _read(node, who, *MAX_TORQUE)
        write_all(node, who, [limit])
    return before


def _dictionary(drive: Drive) -> ObjectDictionary:
    """Return the drive's EDS; raises LinkRefused if it lacks a required object."""
    if not drive.eds:
        return canopen.ObjectDictionary()  # type: ignore[no-untyped-call]
    try:
        dictionary = canopen.import_od(drive.eds)
    except (OSError, ValueError, KeyError) as error:
        raise LinkRefused(f"drive.eds: {drive.eds} cannot be read: {error}") from None
    lacking = {item.place for item in all_objects(drive, 1, OPTIONAL)} - set(dictionary)
    if lacking:
        names = ", ".join(f"{index:04X}h" for index in sorted(lacking))
        raise LinkRefused(f"drive.eds: {drive.eds} has no {names}: this drive cannot be used")
    return dictionary


def _configure(node: canopen.RemoteNode, joint: Joint, drive: Drive) -> frozenset[int]:
    """Configure one drive in pre-operational, where mappings may be changed; return its missing entries."""
    node.nmt.send_command(0x80)
    _identify(node, joint, drive)
    who = _who(joint)
    missing = frozenset(entry for entry in OPTIONAL if not _has(node, who, entry >> 16, entry >> 8 & 0xFF))
    if missing:
        log.info("%s: its drive has no %s", joint.name, ", ".join(f"{entry >> 16:04X}h" for entry in missing))
    write_all(node, who, all_objects(drive, joint.id, missing))
    _await_mode(node, who)
    return missing


def _has(node: canopen.RemoteNode, who: NodeName, index: int, sub: int) -> bool:
    """Return False if the drive reports that the object does not exist; raises LinkLost."""
    try:
        _transfer(who, lambda: node.sdo.upload(index, sub))
    except SdoAbortedError as error:
        return error.code not in {_NO_OBJECT, _NO_SUB}
    return True


def write_all(node: canopen.RemoteNode, who: NodeName, objects: list[Object]) -> None:
    """Write objects in their order and verify the final values; raises LinkLost or LinkRefused."""
    for item in objects:
        _write(node, who, item)
    for item in final_values(objects):
        actual = _read(node, who, item.place, item.sub)
        if actual != item.value:
            raise LinkRefused(f"{who.name}: {item.name} ({item.what}) is {actual:#x}, wanted {item.value:#x}")


def _await_mode(node: canopen.RemoteNode, who: NodeName) -> None:
    """Wait until the drive displays the requested mode; raises LinkRefused if it does not."""
    for _ in range(_MODE_TRIES):
        shown = _read(node, who, *MODE_DISPLAY)
        if shown == CYCLIC_POSITION:
            return
    raise LinkRefused(
        f"{who.name}: 6061h:0 (mode shown) is {shown}, wanted {CYCLIC_POSITION}: it does not take the mode"
    )


def _identify(node: canopen.RemoteNode, joint: Joint, drive: Drive) -> None:
    """Raise LinkRefused for a device that is not the drive in the description."""
    who = _who(joint)
    kind = _read(node, who, *DEVICE_TYPE) & 0xFFFF
    if kind != PROFILE_402:
        raise LinkRefused(
            f"{joint.name}: 1000h:0 says profile {kind}, wanted 402: another device has id {joint.id}"
        )
    for sub, wanted in ((1, drive.vendor), (2, drive.product)):
        if wanted is not None and (actual := _read(node, who, 0x1018, sub)) != wanted:
            raise LinkRefused(
                f"{joint.name}: 1018h:{sub} is {actual:#x}, wanted {wanted:#x}: another make of drive"
            )
    modes = _read(node, who, *MODES)
    if not modes >> (CYCLIC_POSITION - 1) & 1:
        raise LinkRefused(f"{joint.name}: 6502h:0 is {modes:#x}: it has no cyclic synchronous position mode")


def _write(node: canopen.RemoteNode, who: NodeName, item: Object) -> None:
    """Write an object; a read-only one is checked by the verification."""
    data = item.value.to_bytes(item.size, "little")
    try:
        _transfer(who, lambda: node.sdo.download(item.place, item.sub, data))
    except SdoAbortedError as error:
        if error.code != _READ_ONLY:
            raise _refused(who, item.name, item.what, error) from None
        log.info("%s: %s is read-only", who.name, item.name)


def _read(node: canopen.RemoteNode, who: NodeName, index: int, sub: int) -> int:
    """Return an object as an unsigned number."""
    try:
        return int.from_bytes(_transfer(who, lambda: node.sdo.upload(index, sub)), "little")
    except SdoAbortedError as error:
        raise _refused(who, f"{index:04X}h:{sub}", "to be read", error) from None


def _transfer(who: NodeName, request: Callable[[], TransferredT]) -> TransferredT:
    """Return the result of an SDO transfer, repeated if unanswered; raises LinkLost or SdoAbortedError."""
    for _ in range(_TRIES):
        try:
            return request()
        except SdoCommunicationError as error:
            log.debug("%s: %s", who.name, error)
    raise _silent(who)


def _refused(who: NodeName, name: str, what: str, error: SdoAbortedError) -> LinkRefused:
    why = _ABORTS.get(error.code, "the drive refused it")
    return LinkRefused(f"{who.name}: {name} ({what}): {why} (SDO abort {error.code:08X}h)")


def _silent(who: NodeName) -> LinkLost:
    return LinkLost(
        f"{who.name}: id {who.id} on bus {who.bus!r} does not answer; check power, wiring, id, bitrate"
    )


def _who(joint: Joint) -> NodeName:
    return NodeName(joint.name, joint.bus, joint.id)
