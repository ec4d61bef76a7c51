"""Commands for the payload: gimbal and camera. None of them moves the vehicle."""

from __future__ import annotations

from typing import Annotated, Literal

from fleet import Range, Refused, command
from fleet_mavlink.gimbal import GimbalTurn
from fleet_mavlink.session_adapter import SessionAdapter

_TENTH = 0.1  # degrees per second: unit of the rates ``pitch``, ``yaw`` and ``roll``
_RATE = 30.0  # degrees per second
_Angle = Annotated[float, Range(-360, 360, "degrees")]
_Tenths = Annotated[float, Range(-3599, 3599, "tenths of a degree a second")]
_Speed = Annotated[float, Range(-360, 360, "degrees a second")]
_Seconds = Annotated[float, Range(0, 60, "s")]


class PayloadCommands(SessionAdapter):
    """Gimbal and camera."""

    @command("gimbal_rotate", timeout=80.0, moves=False)
    async def gimbal_rotate(
        self,
        *,
        pitch: _Angle | None = None,
        yaw: _Angle | None = None,
        roll: _Angle | None = None,
        mode: Literal["absolute", "relative"] = "absolute",
        duration: _Seconds = 0.0,
    ) -> None:
        """Turn the gimbal to angles (degrees; pitch down is negative, yaw is relative to the nose)."""
        if roll:
            raise Refused("a gimbal manager takes no roll", hint="give pitch and yaw")
        if pitch is None and yaw is None:
            raise Refused("give pitch, yaw, or both")
        await self._session.gimbal.turn(GimbalTurn(pitch, yaw, mode == "relative", duration))

    @command("set_gimbal_pitch", timeout=20.0, moves=False)
    async def set_gimbal_pitch(self, *, pitch: _Angle) -> None:
        """Turn the gimbal's pitch to an angle (degrees, down is negative)."""
        await self._session.gimbal.turn(GimbalTurn(pitch, None))

    @command("gimbal_rotate_speed", moves=False)
    async def gimbal_rotate_speed(
        self,
        *,
        pitch: _Tenths | None = None,
        yaw: _Tenths | None = None,
        roll: _Tenths | None = None,
        pitch_rate: _Speed | None = None,
        yaw_rate: _Speed | None = None,
    ) -> None:
        """Turn the gimbal for 1 s: pitch, yaw in 0.1 degrees per second, or rates in degrees per second."""
        if roll:
            raise Refused("a gimbal manager takes no roll", hint="give pitch and yaw")
        if all(each is None for each in (pitch, yaw, pitch_rate, yaw_rate)):
            raise Refused("give pitch, yaw, pitch_rate or yaw_rate")
        await self._session.gimbal.spin(_speed(pitch, pitch_rate), _speed(yaw, yaw_rate))

    @command("gimbal_pitch_up", moves=False)
    async def gimbal_pitch_up(self, *, rate: _Speed = _RATE) -> None:
        """Turn the gimbal up for 1 s (degrees per second)."""
        await self._session.gimbal.spin(abs(rate), 0.0)

    @command("gimbal_pitch_down", moves=False)
    async def gimbal_pitch_down(self, *, rate: _Speed = _RATE) -> None:
        """Turn the gimbal down for 1 s (degrees per second)."""
        await self._session.gimbal.spin(-abs(rate), 0.0)

    @command("take_photo", timeout=15.0, moves=False)
    async def take_photo(self) -> dict[str, object]:
        """Take a picture; the answer has its number and its location on the camera."""
        photo = await self._session.camera.take_photo()
        return {"index": photo.index, "url": photo.url}


def _speed(tenths: float | None, rate: float | None) -> float:
    """Return degrees per second from either unit."""
    return rate if rate is not None else _TENTH * (tenths or 0.0)
