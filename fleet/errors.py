"""Every error of the project, as a tree whose branches say what to do about it.

    FleetError
    ├── ConfigError          fleet.yaml is wrong: a person edits it
    ├── WireError            bytes or JSON from outside were refused, with the place
    ├── LinkError            the way to a robot
    │   ├── LinkLost         it fell: the host opens it again
    │   └── LinkRefused      it cannot be opened as configured: a person must act
    ├── BusError             the Zenoh session could not be opened
    ├── CloudError           the broker refused us, and why
    ├── StateError           what must outlive the edge cannot be kept where it was to be
    │   ├── StateTaken       another edge that runs has that place
    │   └── StateNewer       a newer fleet wrote the file
    ├── NotRunning           no edge answers
    ├── MetricsError         the figures for Prometheus cannot be served
    └── CommandError         a command was not carried out
        ├── NotReady         not now; try again (``hint`` says when)
        ├── Refused          this command, for this reason
        ├── Unsupported      this robot cannot do it at all
        ├── TimedOut         the robot did not answer in time
        └── Fault            a person must look at the robot

Every message is one line, written for the person who reads it: what, where, what to do.
"""

from __future__ import annotations


class FleetError(Exception):
    """The root of all errors that this project raises on purpose."""


class ConfigError(FleetError):
    """fleet.yaml cannot be used; ``str(error)`` lists every problem, one a line."""


class WireError(FleetError):
    """A message from outside was refused.

    ``where`` is the dotted path of the offending field, empty for the message as a whole.
    """

    def __init__(self, message: str, *, where: str = "") -> None:
        super().__init__(f"{where}: {message}" if where else message)
        self.where = where


class NotRunning(FleetError):
    """No edge answers."""


class LinkError(FleetError):
    """The way to a robot failed."""


class LinkLost(LinkError):
    """The link fell after it was open, or the other side went silent; it is opened again."""


class LinkRefused(LinkError):
    """The link cannot be opened as configured (permission, port taken, bad address)."""


class BusError(FleetError):
    """The local bus could not be opened or joined."""


class CloudError(FleetError):
    """The broker refused us or went away."""


class StateError(FleetError):
    """The folder of the edge's lasting state cannot be used, or another edge has it."""


class StateTaken(StateError):
    """Another edge that runs has the folder of the lasting state."""


class StateNewer(StateError):
    """A state file has a format number that this fleet does not know yet; ``found`` is that number."""

    def __init__(self, message: str, *, found: int) -> None:
        super().__init__(message)
        self.found = found


class MetricsError(FleetError):
    """The figures for Prometheus cannot be served."""


class CommandError(FleetError):
    """A command was not carried out; ``hint`` says what the asker can do.

    ``device_result`` is the robot's own result code, where it gave one.
    ``messages`` are the robot's own words while it handled the command, oldest first.
    """

    def __init__(
        self,
        reason: str,
        *,
        hint: str = "",
        device_result: str | None = None,
        messages: tuple[str, ...] = (),
    ) -> None:
        super().__init__(f"{reason} ({hint})" if hint else reason)
        self.reason = reason
        self.hint = hint
        self.device_result = device_result
        self.messages = messages


class NotReady(CommandError):
    """The robot cannot do this now; it may be asked again."""


class Refused(CommandError):
    """The robot, or the host on its behalf, refused this command."""


class Unsupported(CommandError):
    """This robot cannot do this at all."""


class TimedOut(CommandError):
    """The robot did not answer within the command's time-out."""


class Fault(CommandError):
    """The robot is in a state that a person must look at."""
