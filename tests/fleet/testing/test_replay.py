"""A regression test made of a recording, as an author of an adapter writes it."""

from pathlib import Path

from fleet.testing.replay import differences_from
from fleet_mavlink.adapter import MavlinkAdapter

RECORDING = Path(__file__).parents[2] / "data" / "recordings" / "ap_copter_full_flight.mcap"
KESTREL = {
    "name": "kestrel",
    "twin": "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f",
    "adapter": "mavlink",
    "link": "udpin:127.0.0.1:24550",
}


def test_a_recorded_flight_is_reported_as_it_was(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert differences_from(RECORDING, MavlinkAdapter, KESTREL | {"failsafes": "ignore"}) == []
