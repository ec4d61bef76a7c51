"""MAVLink messages of traffic (ADS-B) and Remote ID (Open Drone ID), as typed values."""

from __future__ import annotations

from typing import ClassVar

from pymavlink.dialects.v20 import all as dialect

from fleet_mavlink.messages import MavlinkMessage


class AdsbVehicle(MavlinkMessage, frozen=True):
    """ADSB_VEHICLE: another aircraft; ``flags`` marks the valid fields (ADSB_FLAGS)."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_ADSB_VEHICLE
    ICAO_address: int
    lat: int  # degrees times 1e7
    lon: int
    altitude: int  # mm AMSL
    heading: int  # of its course, 0.01 degrees
    hor_velocity: int  # cm/s
    ver_velocity: int  # cm/s, up
    flags: int
    altitude_type: int  # 1: geometric (GNSS)
    callsign: str  # 8 characters
    emitter_type: int  # 14: unmanned
    tslc: int  # s since the last reception


class OpenDroneIdBasicId(MavlinkMessage, frozen=True):
    """OPEN_DRONE_ID_BASIC_ID: identity of the aircraft; ``uas_id`` has 20 bytes."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_OPEN_DRONE_ID_BASIC_ID
    target_system: int
    target_component: int
    id_type: int  # 1: serial number
    ua_type: int
    uas_id: tuple[int, ...]


class OpenDroneIdSelfId(MavlinkMessage, frozen=True):
    """OPEN_DRONE_ID_SELF_ID: purpose of the flight, as text."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_OPEN_DRONE_ID_SELF_ID
    target_system: int
    target_component: int
    description_type: int  # 0: text
    description: str


class OpenDroneIdSystem(MavlinkMessage, frozen=True):
    """OPEN_DRONE_ID_SYSTEM: position of the operator; degrees times 1e7, m above the ellipsoid."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_OPEN_DRONE_ID_SYSTEM
    target_system: int
    target_component: int
    operator_location_type: int  # 2: fixed
    classification_type: int  # 1: of the European Union
    operator_latitude: int
    operator_longitude: int
    area_count: int
    area_radius: int
    area_ceiling: float
    area_floor: float
    category_eu: int
    class_eu: int
    operator_altitude_geo: float
    timestamp: int  # s since 2019


class OpenDroneIdOperatorId(MavlinkMessage, frozen=True):
    """OPEN_DRONE_ID_OPERATOR_ID: identity of the operator."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_OPEN_DRONE_ID_OPERATOR_ID
    target_system: int
    target_component: int
    operator_id_type: int  # 0: issued by the aviation authority
    operator_id: str


class OpenDroneIdArmStatus(MavlinkMessage, frozen=True):
    """OPEN_DRONE_ID_ARM_STATUS: 0 if the transmitter permits arming, else the reason."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_OPEN_DRONE_ID_ARM_STATUS
    status: int
    error: str


class OpenDroneIdSystemUpdate(MavlinkMessage, frozen=True):
    """OPEN_DRONE_ID_SYSTEM_UPDATE: the part of OPEN_DRONE_ID_SYSTEM that changes."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_OPEN_DRONE_ID_SYSTEM_UPDATE
    target_system: int
    target_component: int
    operator_latitude: int
    operator_longitude: int
    operator_altitude_geo: float
    timestamp: int


INCOMING: tuple[type[MavlinkMessage], ...] = (OpenDroneIdArmStatus,)
OUTGOING: tuple[type[MavlinkMessage], ...] = (
    AdsbVehicle,
    OpenDroneIdBasicId,
    OpenDroneIdOperatorId,
    OpenDroneIdSelfId,
    OpenDroneIdSystem,
    OpenDroneIdSystemUpdate,
)
