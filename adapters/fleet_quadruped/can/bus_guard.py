"""Guard against a second controller on the bus: two controllers at once make the robot fall."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from fleet import CanBus, Clock, LinkLost

LISTEN = 0.25  # s: the slowest controller sends 10 frames a second
BusAddress = tuple[str, int]
"""Name of a bus, and identifier of a frame."""


def require_sole_controller(buses: Mapping[str, CanBus], ours: Collection[BusAddress], clock: Clock) -> None:
    """Listen before the first frame is sent; raises LinkLost if another node sends one of ``ours``.

    The sender may be a second program, or the former controller, which is still sitting the robot down.
    """
    until = clock.monotonic() + LISTEN
    while clock.monotonic() < until:
        for name, bus in buses.items():
            for frame in bus.receive(0.02):
                if (name, frame.id) in ours:
                    raise LinkLost(
                        f"bus {name!r}: another controller commands the drives (frame {frame.id:03X}h); "
                        "only one may: end the other, or wait until it has sat the dog down"
                    )
