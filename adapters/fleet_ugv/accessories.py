"""Lamps and camera mount of a base: what was commanded last, and the bytes for what is commanded next."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from fleet import JointRange
from fleet_ugv.board import Board
from fleet_ugv.codecs.waveshare import GIMBAL_SPEED

MOUNT: Mapping[str, JointRange] = MappingProxyType(
    {
        "pan": JointRange(-math.pi, math.pi, GIMBAL_SPEED),
        "tilt": JointRange(-math.pi / 6, math.pi / 2, GIMBAL_SPEED),
    }
)
"""Joints of the camera mount: the firmware's ranges, and the speed that is sent with each angle."""


class Lamps:
    """Levels of the two lamps, 0 to 255."""

    def __init__(self) -> None:
        self.chassis = 0
        self.camera = 0

    def set(self, board: Board, *, chassis: int | None = None, camera: int | None = None) -> None:
        """Set the lamps; one without a level keeps its own."""
        levels = self.chassis if chassis is None else chassis, self.camera if camera is None else camera
        board.write(board.codec.lights(*levels))
        self.chassis, self.camera = levels


class CameraMount:
    """Pan (right positive) and tilt (up positive) of the camera, rad."""

    def __init__(self) -> None:
        self._commanded = (0.0, 0.0)
        self._led = False  # it was moved by joint targets since its last absolute command

    def aimed(self, board: Board) -> tuple[float, float]:
        """Return the start of a relative turn: the last commanded angles, or the measured ones."""
        measured = board.observer.mount
        return measured if self._led and measured is not None else self._commanded

    def turn(self, board: Board, pan: float, tilt: float) -> None:
        """Turn the camera, within the range of the mount."""
        panned, tilted = MOUNT["pan"], MOUNT["tilt"]
        camera = (min(max(pan, panned.least), panned.most), min(max(tilt, tilted.least), tilted.most))
        board.write(board.codec.gimbal(round(math.degrees(camera[0])), round(math.degrees(camera[1]))))
        self._commanded, self._led = camera, False
        board.observer.camera = camera

    def turn_by(self, board: Board, *, pan: float = 0.0, tilt: float = 0.0) -> None:
        """Turn the camera further."""
        at = self.aimed(board)
        self.turn(board, at[0] + pan, at[1] + tilt)

    def lead(self, board: Board, targets: Mapping[str, float]) -> None:
        """Turn the camera to joint targets; a joint that is not named keeps its target."""
        pan, tilt = self.aimed(board)
        self.turn(board, targets.get("pan", pan), targets.get("tilt", tilt))
        self._led = True
