"""Section ``remote_id`` of fleet.yaml: Remote ID of an aircraft."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from fleet import Model


def _plain(text: str) -> str:
    """Raise ValueError for text that Remote ID cannot carry."""
    if not text.isascii() or not text.isprintable():
        raise ValueError("printable ASCII characters only")
    return text


_Text = Annotated[str, AfterValidator(_plain)]


class RemoteIdConfig(Model):
    """Operator of the aircraft, and their position: sent to the autopilot for its Remote ID transmitter."""

    operator_id: _Text = Field("", max_length=20, description="As the aviation authority gave it.")
    latitude: float = Field(ge=-90, le=90, description="Of the operator, degrees, WGS-84.")
    longitude: float = Field(ge=-180, le=180, description="Of the operator, degrees, WGS-84.")
    altitude: float = Field(
        -1000.0, ge=-1000, le=31767, description="Of the operator, m above the ellipsoid; -1000: unknown."
    )
    serial_number: _Text = Field(
        "",
        max_length=20,
        description="Of the aircraft (ANSI/CTA-2063), for a transmitter that does not know it.",
    )
    description: _Text = Field("", max_length=23, description="What the flight is for.")
    category: Literal["undeclared", "open", "specific", "certified"] = Field(
        "undeclared", description="Category of the flight in the European Union."
    )
    class_eu: int = Field(0, ge=0, le=7, description="Class of the aircraft in the European Union plus 1.")
