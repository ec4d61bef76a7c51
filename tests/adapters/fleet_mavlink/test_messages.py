"""Every message of the tables agrees with pymavlink's definition: name, fields, types, order, checksum."""

import inspect
import struct
from typing import get_type_hints

import pytest
from pymavlink.dialects.v20 import all as mav
from pymavlink.generator import mavparse

from fleet_mavlink import (
    broadcast_messages,
    event_messages,
    messages,
    mission_messages,
    payload_messages,
    transfer_messages,
)
from fleet_mavlink.codec import FrameSettings, Parser, is_read, pack
from fleet_mavlink.event_messages import Event, EventWire
from fleet_mavlink.messages import MavlinkMessage

MODULES = (
    broadcast_messages,
    event_messages,
    messages,
    mission_messages,
    payload_messages,
    transfer_messages,
)
INCOMING = [kind for module in MODULES for kind in module.INCOMING]
OUTGOING = [kind for module in MODULES for kind in module.OUTGOING]
KINDS = sorted({*INCOMING, *OUTGOING}, key=lambda kind: kind.message_id)
BITS = "param_value"  # 32 bits here, a float in the dialect: see ParamValue
EVENT_XML = """<mavlink><messages><message id="410" name="EVENT"><description>Event</description>
<field type="uint8_t" name="destination_component">Component ID</field>
<field type="uint8_t" name="destination_system">System ID</field>
<field type="uint32_t" name="id">Event ID</field>
<field type="uint32_t" name="event_time_boot_ms">Timestamp</field>
<field type="uint16_t" name="sequence">Sequence number</field>
<field type="uint8_t" name="log_levels">Log levels</field>
<field type="uint8_t[40]" name="arguments">Arguments</field>
</message></messages></mavlink>"""
"""EVENT in MAVLink's common.xml, without its long descriptions."""


def wire_of(kind):
    """Return pymavlink's definition of a message, or the one of EVENT, which pymavlink lacks."""
    return EventWire if kind is Event else mav.mavlink_map[kind.message_id]


def fields_of(wire):
    """Return type and array length of each field by name, in the order of the definition."""
    lengths = dict(zip(wire.ordered_fieldnames, wire.array_lengths, strict=True))
    types = zip(wire.fieldnames, wire.fieldtypes, strict=True)
    return {name: (kind, lengths[name]) for name, kind in types}


def python_type(name, kind, length):
    """Return the type of a field in Python."""
    if kind == "char":
        return str
    one = float if kind in ("float", "double") and name != BITS else int
    return tuple[one, ...] if length else one


def values_of(wire):
    """Return a value for each field, all different, that fits its type and that no rounding changes."""
    found = {}
    for index, (name, (kind, length)) in enumerate(fields_of(wire).items(), 1):
        if kind == "char":
            found[name] = f"t{index}"[: length or 1]
        elif length:
            found[name] = tuple((index + at) % 100 for at in range(length))
        else:
            found[name] = index + 0.5 if kind in ("float", "double") else index
    return found


def as_ours(name, value):
    """Return a value of pymavlink in the form of our messages."""
    if name == BITS:
        return struct.unpack("<I", struct.pack("<f", value))[0]
    return tuple(value) if isinstance(value, list) else value


def example(kind):
    """Return a message of ours with a value in each field."""
    values = values_of(wire_of(kind))
    return kind(**{name: as_ours(name, values[name]) for name in kind.__struct_fields__})


def encoded(values):
    """Return values as pymavlink's constructors take them: texts as bytes, arrays as lists."""
    kinds = {str: str.encode, tuple: list}
    return {name: kinds.get(type(value), lambda same: same)(value) for name, value in values.items()}


def test_every_message_is_in_a_table():
    defined = {
        each
        for module in MODULES
        for _, each in inspect.getmembers(module, inspect.isclass)
        if issubclass(each, MavlinkMessage) and each is not MavlinkMessage
    }
    assert defined == set(KINDS)
    assert all(is_read(kind.message_id) for kind in INCOMING)


@pytest.mark.parametrize("kind", KINDS)
def test_a_message_has_the_name_and_the_field_types_of_the_dialect(kind):
    wire = wire_of(kind)
    assert kind.__doc__.replace(":", " ").split()[0] == wire.msgname
    hints, known = get_type_hints(kind), fields_of(wire)
    ours = {name: hints[name] for name in kind.__struct_fields__}
    assert ours == {name: python_type(name, *known[name]) for name in ours}


@pytest.mark.parametrize("kind", KINDS)
def test_a_packing_of_ours_differs_from_the_dialect_in_the_bits_of_a_parameter_only(kind):
    wire = wire_of(kind)
    kinds = [fields_of(wire)[name][0] for name in wire.ordered_fieldnames]
    own = struct.Struct(kind.packing or wire.unpacker.format)
    if BITS in wire.fieldnames and kind.packing:
        assert kinds.count("float") == 1
        assert own.format.replace("I", "f") == wire.unpacker.format
    else:
        assert own.format == wire.unpacker.format


@pytest.mark.parametrize("kind", [kind for kind in INCOMING if kind is not Event])
def test_every_field_that_pymavlink_writes_is_read(kind, frame_of):
    values = values_of(wire_of(kind))
    (frame,) = Parser().feed(frame_of(wire_of(kind)(**encoded(values))))
    assert type(frame.message) is kind
    assert frame.message == example(kind)


@pytest.mark.parametrize("kind", OUTGOING)
def test_every_field_that_is_written_is_read_by_pymavlink(kind):
    values = {name: values_of(wire_of(kind))[name] for name in kind.__struct_fields__}
    (read,) = mav.MAVLink(None).parse_buffer(bytearray(pack(example(kind), 245, 191, 0)))
    assert read.get_type() == wire_of(kind).msgname
    for name in read.get_fieldnames():
        value = getattr(read, name)
        found = tuple(value) if isinstance(value, list) else value
        if name in values:
            assert found == values[name]
        else:
            assert not any(found) if isinstance(found, tuple) else not found


@pytest.mark.parametrize("kind", OUTGOING)
def test_a_message_is_framed_in_version_1_where_that_has_it(kind):
    frame = pack(example(kind), 245, 191, 7, FrameSettings(version=1))
    (message,) = mav.MAVLink(None).parse_buffer(bytearray(frame))
    assert message.get_msgbuf()[0] == (0xFE if kind.message_id < 256 else 0xFD)
    assert (message.get_msgId(), message.get_srcSystem(), message.get_seq()) == (kind.message_id, 245, 7)


def test_event_is_what_pymavlinks_generator_makes_of_its_definition(tmp_path):
    path = tmp_path / "event.xml"
    path.write_text(EVENT_XML)
    (made,) = mavparse.MAVXML(str(path), mavparse.PROTOCOL_2_0).message
    assert EventWire.msgname == made.name
    assert EventWire.crc_extra == made.crc_extra
    assert EventWire.fieldnames == made.fieldnames
    assert EventWire.fieldtypes == made.fieldtypes
    assert EventWire.ordered_fieldnames == made.ordered_fieldnames
    assert EventWire.array_lengths == [field.array_length for field in made.ordered_fields]
    assert EventWire.lengths == [field.array_length or 1 for field in made.ordered_fields]
    letters = {"uint8_t": "B", "uint16_t": "H", "uint32_t": "I"}
    formats = [f"{field.array_length or ''}{letters[field.type]}" for field in made.ordered_fields]
    assert EventWire.unpacker.format == "<" + "".join(formats)
