"""Faults of a simulated base: those of the wire, and its own."""

from __future__ import annotations

from collections.abc import Mapping

from fleet.sim.faults import WIRE_FAULTS

BASE_FAULTS: Mapping[str, str] = {
    "reset": "the board restarts now; its counters begin anew",
    "stall": "the wheels do not turn, whatever is asked",
    "slip": "share of the wheels' way that does not move the base, 0 to 1",
    "bump": "radians by which something turns the base, now",
    "mute": "the board obeys and says nothing",
    "partial": "every piece that the board says is cut in two",
    "garbage": "junk bytes before every piece that the board says",
    "echo": "the board echoes its input",
    "low_battery": "volts that are left from now on",
    "no_confirm": "the board does not take its dead-man's time",
    "unplug": "seconds for which the cable is out, from now on",
}
FAULTS: Mapping[str, str] = {**WIRE_FAULTS, **BASE_FAULTS}
