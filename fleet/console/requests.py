"""Requests of a page over its WebSocket, and the permission that each needs; strict, without I/O."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import msgspec

from fleet.console.numbers import LONGEST
from fleet.errors import WireError
from fleet.model.permission import Permission, needed_for_command
from fleet.runtime.decoding import json_decoder

MOST_ROBOTS = 1000  # in one request
LONGEST_WORD = 200  # characters of an identity, a name, a reason
LONGEST_SDP = 12_000  # characters of a session description
MOST_SERIES = 20  # numbers of a robot in one request
MOST_POINTS = 1000  # of one number
FASTEST = 50.0  # m/s or rad/s; the edge enforces each robot's own limits

NumberName = Annotated[str, msgspec.Meta(max_length=LONGEST)]
Speed = Annotated[float, msgspec.Meta(ge=-FASTEST, le=FASTEST)]


class PageStopRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="stop"):
    """Stop these robots (``edge/robot``); none means all. ``request`` is equal on all routes."""

    request: str
    robots: tuple[str, ...] = ()
    why: str = ""


class PageReleaseRequest(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="release"
):
    """Release these robots from their emergency stop."""

    request: str
    robots: tuple[str, ...]


class PageGotoRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="goto"):
    """Send these robots to a point in the site's frame, m; ``spacing`` metres from each other.

    Without ``z`` each keeps its height.
    """

    request: str
    robots: tuple[str, ...]
    x: float
    y: float
    z: float | None = None
    spacing: float | None = None


class PageCommandRequest(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="command"
):
    """Send a robot a command with its data."""

    request: str
    robot: str
    command: str
    data: dict[str, Any] = {}


class PageDriveRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="drive"):
    """Hold a velocity: m/s and rad/s in the robot's body frame (x forward, y left, z up).

    ``number`` is returned with the answer: the page measures the round-trip time.
    """

    number: int
    robot: str
    linear_x: Speed = 0.0
    linear_y: Speed = 0.0
    linear_z: Speed = 0.0
    angular_z: Speed = 0.0

    @property
    def is_zero(self) -> bool:
        """True if the stick is released."""
        return not (self.linear_x or self.linear_y or self.linear_z or self.angular_z)


class PageMissionRequest(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="mission"
):
    """Start a mission of an edge."""

    request: str
    edge: str
    name: str
    inputs: dict[str, Any] = {}


class PageRehearseRequest(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="rehearse"
):
    """Rehearse a mission of an edge with simulated robots; answered with its progress until its end."""

    request: str
    edge: str
    name: str
    inputs: dict[str, Any] = {}


class PageRunRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="run"):
    """Control a run, or answer its ``question``."""

    request: str
    edge: str
    run: str
    do: Literal["pause", "resume", "abort", "answer"]
    question: int = 0
    goes_on: bool = False


class PageControlRequest(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="control"
):
    """Ask the holder of a robot's control to give it up."""

    request: str
    robot: str


class PageGiveRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="give"):
    """Answer a request for control of one's robot: give it up, which stops the robot, or keep it."""

    request: str
    robot: str
    give: bool


class ScheduleChange(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="schedule"
):
    """Enable or disable a schedule of an edge, or start its mission now."""

    request: str
    edge: str
    name: str
    do: Literal["enable", "disable", "run"]


class PageWatchRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="watch"):
    """Follow a robot's vocabulary and reports while its view is open; an empty name: none."""

    robot: str = ""


class PageCausesRequest(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="causes"
):
    """Get who stopped these robots, when and why."""

    request: str
    robots: tuple[str, ...]


class PageHistoryRequest(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="history"
):
    """Get the recent requests to a robot, their senders and outcomes."""

    request: str
    robot: str


class PageExtentRequest(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="extent"
):
    """Get the time range of the recordings."""

    request: str


class PageMomentRequest(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="moment"
):
    """Get the fleet at a moment of the recordings, Unix s."""

    request: str
    at: float


class PageSeriesRequest(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="series"
):
    """Get numbers of a robot from the recordings, received from ``since`` until ``until``, Unix s.

    ``names`` are those of the live numbers; ``points`` are the most of each.
    """

    request: str
    robot: str
    since: float
    until: float
    names: Annotated[tuple[NumberName, ...], msgspec.Meta(max_length=MOST_SERIES)] = ()
    points: Annotated[int, msgspec.Meta(ge=2, le=MOST_POINTS)] = MOST_POINTS


class PageConfigRequest(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="config"
):
    """Get the fleet.yaml of an edge and its errors."""

    request: str
    edge: str


class PageVideoRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="video"):
    """Get the next offer of live video of a watched robot; sent before ``start_video``."""

    request: str
    robot: str


class VideoAnswered(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="video_answer"
):
    """Answer an offer of live video with the page's own session description."""

    request: str
    robot: str
    sensor: str
    sdp: Annotated[str, msgspec.Meta(max_length=LONGEST_SDP)]


class PagePingRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="ask", tag="ping"):
    """Answer at once with the same number: the page measures the round-trip time."""

    number: int


AnsweredRequest = (
    PageStopRequest
    | PageReleaseRequest
    | PageGotoRequest
    | PageCommandRequest
    | PageCausesRequest
    | PageHistoryRequest
    | PageMissionRequest
    | PageRehearseRequest
    | PageRunRequest
    | PageControlRequest
    | PageGiveRequest
    | ScheduleChange
    | PageExtentRequest
    | PageMomentRequest
    | PageSeriesRequest
    | PageConfigRequest
    | PageVideoRequest
    | VideoAnswered
)
"""Requests that are answered by their id."""
PageRequest = AnsweredRequest | PageDriveRequest | PageWatchRequest | PagePingRequest

_NEEDS: Mapping[type[object], Permission] = {
    PageStopRequest: Permission.VIEW,
    PageWatchRequest: Permission.VIEW,
    PageCausesRequest: Permission.VIEW,
    PageHistoryRequest: Permission.VIEW,
    PageExtentRequest: Permission.VIEW,
    PageMomentRequest: Permission.VIEW,
    PageSeriesRequest: Permission.VIEW,
    PagePingRequest: Permission.VIEW,
    PageReleaseRequest: Permission.OPERATE,
    PageGotoRequest: Permission.OPERATE,
    PageDriveRequest: Permission.OPERATE,
    PageMissionRequest: Permission.OPERATE,
    PageRehearseRequest: Permission.OPERATE,
    PageRunRequest: Permission.OPERATE,
    PageControlRequest: Permission.OPERATE,
    PageGiveRequest: Permission.OPERATE,
    ScheduleChange: Permission.OPERATE,
    PageVideoRequest: Permission.OPERATE,
    VideoAnswered: Permission.OPERATE,
    PageConfigRequest: Permission.ADMIN,
}
"""The permission that each request needs; a stop needs none."""


_WORDS = ("request", "robot", "command", "why", "edge", "name", "run", "sensor")
"""Fields with a name or a text."""


def needed_for(requested: PageRequest) -> Permission:
    """Return the permission that a request needs."""
    if isinstance(requested, PageCommandRequest):
        return needed_for_command(requested.command)
    return _NEEDS[type(requested)]


def read_requested(text: str | bytes) -> PageRequest:
    """Decode a message of a page; raises WireError."""
    try:
        requested: PageRequest = json_decoder(PageRequest).decode(text)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise WireError(str(error)[:LONGEST_WORD]) from None
    _require_bounds(requested)
    return requested


def read_stop(body: bytes) -> PageStopRequest:
    """Decode a stop sent by POST; raises WireError."""
    requested = read_requested(body)
    if not isinstance(requested, PageStopRequest):
        raise WireError("only a stop is taken here")
    return requested


def _require_bounds(requested: PageRequest) -> None:
    """Raise WireError for implausibly many robots or long texts."""
    robots = getattr(requested, "robots", ())
    if len(robots) > MOST_ROBOTS:
        raise WireError(f"more than {MOST_ROBOTS} robots", where="robots")
    words = [*robots, *(getattr(requested, field, "") for field in _WORDS)]
    if any(len(word) > LONGEST_WORD for word in words):
        raise WireError(f"a name or text has more than {LONGEST_WORD} characters")
