"""The timelines of the recordings: what the adapter sees of each vehicle, a line each.

``python tests/data/mavlink/timelines.py`` writes them again, beside the recordings; look at the difference.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from fleet.testing.clock import ManualClock
from fleet_mavlink.link_hub import LinkHub

HERE = Path(__file__).parent
STATION = (255, 190)  # who made the recordings
POSITION_EVERY = 5.0  # s


class Silent:
    """A link on which nothing is written."""

    url = "replay"


def records(path: Path) -> Iterator[tuple[float, bytes]]:
    """Yield (Unix seconds, frame): 8 bytes of big-endian microseconds before each frame."""
    data = path.read_bytes()
    at = 0
    while at < len(data):
        begin = at + 8
        long = data[begin] == 0xFD
        signature = 13 if long and data[begin + 2] & 1 else 0
        end = begin + (12 if long else 8) + data[begin + 1] + signature
        yield int.from_bytes(data[at:begin], "big") / 1e6, data[begin:end]
        at = end


class Watch:
    """Writes down what is new of one vehicle."""

    def __init__(self, vehicle, lines, clock) -> None:
        self._vehicle = vehicle
        self._lines = lines
        self._clock = clock
        self._known = {"fix": "yes", "estimate": ""}  # nothing is said of what was never told otherwise
        self._position_at = -POSITION_EVERY
        vehicle.on_heartbeat = self.beat
        vehicle.on_ack = lambda ack: self.note("ack", f"{ack.command} {ack.result}")
        vehicle.on_sentence = lambda said: self.note("text", f"{said.severity} {said.text}")

    def note(self, kind: str, value: str) -> None:
        """Write a line."""
        self._lines.append(f"{self._clock.monotonic():8.2f} {self._vehicle.system} {kind:<8} {value}")

    def changed(self, kind: str, value: str) -> None:
        """Write a line when this is not what it was."""
        if self._known.get(kind) != value:
            self._known[kind] = value
            self.note(kind, value)

    def beat(self) -> None:
        """Look at mode and arming, and now and then at the place."""
        state = self._vehicle.state
        kind, now = self._vehicle.kind, self._clock.monotonic()
        self.changed("vehicle", f"{kind.name} type {state.heartbeat.type}")
        self.changed("mode", kind.mode_of(state))
        self.changed("armed", "yes" if state.armed else "no")
        self.changed("failsafe", "yes" if state.failsafe else "no")
        self.changed("reboots", str(state.reboots))
        if state.had_fix:
            self.changed("fix", "yes" if state.fix_now(now) else "lost")
            self.changed("estimate", {True: "trusted", False: "lost"}.get(state.estimator_has_position, ""))
        if state.position is not None and now - self._position_at >= POSITION_EVERY:
            self._position_at = now
            place, height = state.position, state.relative_altitude
            self.note("position", f"{place.latitude:.6f} {place.longitude:.6f} {height:.1f}")


def systems_of(path: Path) -> tuple[int, ...]:
    """Return the autopilots in a recording."""
    hub = LinkHub(Silent(), ManualClock(monotonic=0.0), *STATION)
    for _, frame in records(path):
        hub.receive(frame, None)
    return hub.heard


def timeline(path: Path) -> list[str]:
    """Return the lines of a recording: seconds since its begin, system, what, value."""
    clock, lines = ManualClock(monotonic=0.0), []
    hub = LinkHub(Silent(), clock, *STATION)
    with contextlib.ExitStack() as claims:
        for system in systems_of(path):
            Watch(claims.enter_context(hub.vehicle(system)), lines, clock)
        began = None
        for stamp, frame in records(path):
            began = stamp if began is None else began
            clock.advance(max(0.0, stamp - began - clock.monotonic()))
            hub.receive(frame, None)
    return lines


def main() -> None:
    """Write all of them."""
    for path in sorted(HERE.glob("*.tlog")):
        path.with_suffix(".timeline").write_text("\n".join(timeline(path)) + "\n")


if __name__ == "__main__":
    main()
