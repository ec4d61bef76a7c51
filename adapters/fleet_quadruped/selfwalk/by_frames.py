"""Self-walking machine with proprietary frames: the section ``frames`` of its description."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field, model_validator

from fleet import CanFrame
from fleet_quadruped.frame_integrity import ProtectedFrame
from fleet_quadruped.frames import FrameMap, encode
from fleet_quadruped.robot.parts import Section
from fleet_quadruped.selfwalk.wire import AXES, COMMANDS, WalkerWire


def _axes(frame: FrameMap) -> FrameMap:
    if set(frame.fields) != set(AXES):
        raise ValueError(f"a velocity has the fields {', '.join(AXES)}")
    return frame


def _height(frame: FrameMap) -> FrameMap:
    if set(frame.fields) != {"height"}:
        raise ValueError("it has one field, height")
    return frame


class FixedFrame(Section, ProtectedFrame):
    """A frame with constant data, except for a counter and a checksum."""

    id: int = Field(ge=0, le=0x1FFFFFFF, description="Identifier; extended above 7FFh.")
    data: str = Field(pattern=r"^([0-9a-fA-F]{2}){0,8}$", description="Data of the frame, hex.")

    @model_validator(mode="after")
    def _room(self) -> FixedFrame:
        """Refuse data in the byte of a counter or checksum, or too few bytes for them."""
        data = bytes.fromhex(self.data)
        for place, name in self.integrity_bytes.items():
            if data[place : place + 1] != b"\x00":
                raise ValueError(f"byte {place} of data must be 00: its {name} is there")
        return self

    @property
    def frame(self) -> CanFrame:
        """The frame, without counter and checksum."""
        return CanFrame(self.id, bytes.fromhex(self.data))


class WalkerFrames(Section):
    """Frames by meaning. A command is repeated until the state shows that it was accepted."""

    velocity: Annotated[FrameMap, AfterValidator(_axes)] = Field(description="Sent in every cycle.")
    start: tuple[FixedFrame, ...] = Field((), description="Sent once after the bus is opened.")
    stand_up: FixedFrame
    sit_down: FixedFrame
    emergency_stop: FixedFrame = Field(description="Fastest stop that lowers the machine gently.")
    recovery_stand: FixedFrame | None = None
    reset_faults: FixedFrame | None = None
    height: Annotated[FrameMap, AfterValidator(_height)] | None = Field(None, description="Standing height.")
    state: tuple[FrameMap, ...] = Field(
        min_length=1, description="State that the machine sends in every cycle."
    )
    slow: tuple[FrameMap, ...] = Field((), description="Values sent at a lower rate: percent, voltage.")

    @model_validator(mode="after")
    def _same_protection(self) -> WalkerFrames:
        """Refuse frames of one identifier with different counters or checksums."""
        protected: dict[int, tuple[object, object]] = {}
        for frame in self.outgoing:
            integrity = frame.counter, frame.checksum
            if protected.setdefault(frame.id, integrity) != integrity:
                raise ValueError(f"the frames {frame.id:03X}h must have the same counter and checksum")
        return self

    @property
    def outgoing(self) -> tuple[FrameMap | FixedFrame, ...]:
        """All frames sent to the machine."""
        named = [getattr(self, name) for name in (*COMMANDS, "height")]
        return (self.velocity, *self.start, *(frame for frame in named if frame is not None))


def wire_of(frames: WalkerFrames) -> WalkerWire:
    """Return the messages of the machine."""
    fixed: dict[str, FixedFrame | None] = {name: getattr(frames, name) for name in COMMANDS}
    height = frames.height
    return WalkerWire(
        velocity=(frames.velocity,),
        commands={name: one.frame for name, one in fixed.items() if one},
        height=(lambda metres: CanFrame(height.id, encode(height, {"height": metres}))) if height else None,
        state=frames.state,
        slow=frames.slow,
        start=tuple(one.frame for one in frames.start),
        protected={one.id: one for one in frames.outgoing if one.integrity_bytes},
    )
