"""Faults of a simulated vehicle: those of the wire, and its own."""

from __future__ import annotations

from collections.abc import Mapping

from fleet.sim.faults import WIRE_FAULTS

VEHICLE_FAULTS: Mapping[str, str] = {
    "ack_loss": "share of acknowledgements that are lost while the command is carried out, 0 to 1",
    "no_ack": "no command is acknowledged",
    "state_lag": "seconds by which the mode and the flight state are shown late, as on a slow radio link",
    "slow_ack": "seconds that every command takes; IN_PROGRESS is sent at once",
    "camera_fails": "no picture can be taken",
    "compass_fails": "a calibration of the compass fails at its end",
    "gps_loss": "no satellites",
    "log_fails": "ArduPilot cannot open its log, as it finds when it is armed, and does not arm",
    "low_battery": "percent that is left from now on",
    "not_ready": "the checks before arming never pass",
    "pilot_takeover": "a pilot switches the mode by remote control",
    "rc_loss": "the remote control sends nothing; PX4 only misses one that it has (COM_RC_IN_MODE 0)",
    "reboot": "the autopilot restarts now",
    "remote_id_silent": "the Remote ID transmitter sends nothing",
    "wander": "metres by which PX4 misjudges its height on the ground, up and down, until it takes off",
    "wind": "metres per second of gusty wind from the west; more than 12 carries it away",
}
FAULTS: Mapping[str, str] = {**WIRE_FAULTS, **VEHICLE_FAULTS}
