"""The camera mount: its joints, and the commands that turn it. None of them moves a wheel."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated

from fleet import JointRange, Range, command
from fleet_ugv.accessories import MOUNT, CameraMount
from fleet_ugv.board_adapter import BoardAdapter

NUDGE = 0.1  # rad by which camera_up, _down, _left and _right move
_Pan = Annotated[float, Range(-math.pi, math.pi, "rad")]
_Tilt = Annotated[float, Range(-math.pi / 6, math.pi / 2, "rad")]
_Delta = Annotated[float, Range(-math.tau, math.tau, "rad")]


class MountCommands(BoardAdapter):
    """Pan (right positive) and tilt (up positive) of the camera, rad."""

    _mount: CameraMount

    def joint_ranges(self) -> Mapping[str, JointRange]:
        """Return pan (right positive) and tilt (up positive) of a base with a camera mount."""
        return MOUNT if self._board.codec.gimbal_stop else {}

    def move_joints(self, targets: Mapping[str, float]) -> None:
        """Turn the mount; a joint that is not named keeps its target. Angles are sent in whole degrees."""
        self._mount.lead(self._board, targets)

    def hold_joints(self) -> None:
        """Stop the mount where it is; from any thread."""
        self._board.hold_gimbal()

    @command("camera_up", moves=False, timeout=2.0)
    async def camera_up(self) -> None:
        """Tilt the camera up by 0.1 rad."""
        self._mount.turn_by(self._board, tilt=NUDGE)

    @command("camera_down", moves=False, timeout=2.0)
    async def camera_down(self) -> None:
        """Tilt the camera down by 0.1 rad."""
        self._mount.turn_by(self._board, tilt=-NUDGE)

    @command("camera_left", moves=False, timeout=2.0)
    async def camera_left(self) -> None:
        """Pan the camera left by 0.1 rad."""
        self._mount.turn_by(self._board, pan=-NUDGE)

    @command("camera_right", moves=False, timeout=2.0)
    async def camera_right(self) -> None:
        """Pan the camera right by 0.1 rad."""
        self._mount.turn_by(self._board, pan=NUDGE)

    @command("camera_default", moves=False, timeout=2.0)
    async def camera_default(self) -> None:
        """Turn the camera straight ahead."""
        self._mount.turn(self._board, 0.0, 0.0)

    @command("camera_servo", moves=False, timeout=2.0)
    async def camera_servo(
        self,
        *,
        pan: _Pan | None = None,
        tilt: _Tilt | None = None,
        pan_delta: _Delta = 0.0,
        tilt_delta: _Delta = 0.0,
    ) -> None:
        """Turn the camera to pan and tilt (rad, right and up positive), or by their deltas."""
        at = self._mount.aimed(self._board)
        self._mount.turn(
            self._board,
            (at[0] if pan is None else pan) + pan_delta,
            (at[1] if tilt is None else tilt) + tilt_delta,
        )
