"""Section ``watchers`` of fleet.yaml: ground stations beside the edge."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator

from fleet import LinkRefused, Model, parse_link_url

May = Literal["watch", "operate"]


class WatcherConfig(Model):
    """A ground station that sees the vehicle through this edge, with its permissions."""

    link: str = Field(description="udpout:HOST:PORT, where the station listens; robots may share one.")
    may: May = Field(
        "watch",
        description="watch: it sees all, reads parameters and missions, and stops the vehicle. operate: the "
        "station of this system id commands it as well, and has taken it over then, as a pilot would.",
    )
    station: int = Field(
        255, ge=1, le=255, description="MAVLink system id of the station that operates; others only watch."
    )

    @field_validator("link")
    @classmethod
    def _datagrams(cls, link: str) -> str:
        """Raise ValueError for anything but one target address for datagrams."""
        try:
            scheme = parse_link_url(link).scheme
        except LinkRefused as error:
            raise ValueError(str(error)) from None
        if scheme != "udpout":
            raise ValueError(f"{link!r}: a station is reached by udpout:HOST:PORT, where it listens")
        return link
