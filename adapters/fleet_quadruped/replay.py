"""Text view of a capture: targets and angles of the joints, changes of state of the drives."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from fleet import CanFrame
from fleet_quadruped.can.capture import Captured
from fleet_quadruped.drives import drives_of
from fleet_quadruped.drives.base import JointFeedback
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.joint import Joint

_EVERY = 0.1  # s between two lines about a joint


class SilentBus:
    """A bus that carries nothing: for drives that only receive recorded frames."""

    def __init__(self, name: str) -> None:
        self.name = name

    def send(self, frame: CanFrame) -> None:
        """Send nothing."""

    def receive(self, wait: float) -> list[CanFrame]:  # noqa: ARG002 - nothing ever arrives
        """Return nothing."""
        return []

    def close(self) -> None:
        """Do nothing."""


class DriveReplay:
    """The drives of a robot, fed with captured frames; ``wanted``: the last target of each joint, rad."""

    def __init__(self, dog: DogDescription) -> None:
        self.dog = dog
        self.drives = drives_of(dog, {name: SilentBus(name) for name in dog.buses})
        self.wanted: dict[str, float] = {}
        self._time = 0.0  # of the last frame from a drive

    @property
    def reported(self) -> tuple[JointFeedback, ...]:
        """The last feedback of the joints."""
        return self.drives.feedback(self._time).each()

    def apply(self, captured: Captured) -> None:
        """Apply the next frame."""
        if captured.sent:
            target = self.drives.target(captured.bus, captured.frame)
            if target is not None:
                self.wanted[target[0].name] = target[1]
            return
        self.drives.handle_frame(captured.bus, captured.frame, captured.time)
        self._time = captured.time

    def lines(self, frames: Iterable[Captured], only: str = "") -> Iterator[str]:
        """Yield a line for each change of a drive's state or fault, and ten lines a second about one joint.

        That joint is ``only``, else the one farthest from its target. Times are relative to the last frame.
        """
        found = list(frames)
        end = found[-1].time if found else 0.0
        said: dict[str, tuple[str, str]] = {}
        due = 0.0
        for captured in found:
            self.apply(captured)
            when = f"{captured.time - end:8.3f} s"
            states = {} if captured.sent else self._states()  # only the frames of drives change them
            for name, now in states.items():
                if said.get(name) != now:
                    said[name] = now
                    yield f"{when}  {name:8} is {': '.join(filter(None, now))}"
            if captured.time >= due and self.wanted:
                due = captured.time + _EVERY
                yield f"{when}  {self._farthest(only)}"

    def _states(self) -> dict[str, tuple[str, str]]:
        """Return state and fault of each joint, by its name."""
        feedback = self.drives.feedback(self._time)
        each = zip(self.dog.all_joints, feedback.powers, feedback.faults, strict=True)
        return {joint.name: (power.value, fault) for joint, power, fault in each}

    def _farthest(self, only: str) -> str:
        """Describe the joint that is farthest from its target."""
        pairs: list[tuple[Joint, JointFeedback]] = [
            (joint, reported)
            for joint, reported in zip(self.dog.all_joints, self.reported, strict=True)
            if joint.name in self.wanted and (not only or joint.name == only)
        ]
        if not pairs:
            return f"{only:8} was sent no target"
        joint, reported = max(pairs, key=lambda pair: abs(self.wanted[pair[0].name] - pair[1].angle))
        return (
            f"{joint.name:8} wanted {self.wanted[joint.name]:7.3f} rad, is at {reported.angle:7.3f}, "
            f"{reported.torque:6.2f} N m"
        )
