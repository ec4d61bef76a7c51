"""A machine that speaks frames of its maker's own: the section ``frames`` of its description."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

from fleet_quadruped.can.frame import Frame
from fleet_quadruped.frames import FrameMap, encode
from fleet_quadruped.robot.parts import Section
from fleet_quadruped.selfwalk.wire import AXES, COMMANDS, Wire


def _axes(frame: FrameMap) -> FrameMap:
    if set(frame.fields) != set(AXES):
        raise ValueError(f"a velocity has the fields {', '.join(AXES)}")
    return frame


def _height(frame: FrameMap) -> FrameMap:
    if set(frame.fields) != {"height"}:
        raise ValueError("it has one field, height")
    return frame


class FixedFrame(Section):
    """A frame whose data is always the same."""

    id: int = Field(ge=0, le=0x1FFFFFFF, description="Identifier; beyond 7FFh it is an extended one.")
    data: str = Field(pattern=r"^([0-9a-fA-F]{2}){0,8}$", description="Data, hex.")

    @property
    def frame(self) -> Frame:
        """The frame itself."""
        return Frame(self.id, bytes.fromhex(self.data))


class Frames(Section):
    """Which frame means what. A command is repeated until the state shows that it was taken."""

    velocity: Annotated[FrameMap, AfterValidator(_axes)] = Field(description="Sent in every cycle.")
    start: tuple[FixedFrame, ...] = Field((), description="Sent once, when the bus has been opened.")
    stand_up: FixedFrame
    sit_down: FixedFrame
    emergency_stop: FixedFrame = Field(description="Its firmest stop that lets it down slowly.")
    recovery_stand: FixedFrame | None = None
    reset_faults: FixedFrame | None = None
    height: Annotated[FrameMap, AfterValidator(_height)] | None = Field(None, description="Standing height.")
    state: tuple[FrameMap, ...] = Field(min_length=1, description="What it tells in every cycle.")
    slow: tuple[FrameMap, ...] = Field((), description="What it tells now and then: percent, voltage.")


def wire_of(frames: Frames) -> Wire:
    """Return what goes over the wire."""
    fixed: dict[str, FixedFrame | None] = {name: getattr(frames, name) for name in COMMANDS}
    height = frames.height
    return Wire(
        velocity=(frames.velocity,),
        commands={name: one.frame for name, one in fixed.items() if one},
        height=(lambda metres: Frame(height.id, encode(height, {"height": metres}))) if height else None,
        state=frames.state,
        slow=frames.slow,
        start=tuple(one.frame for one in frames.start),
    )
