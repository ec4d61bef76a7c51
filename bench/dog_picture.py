"""Picture for the documentation: the true path of a simulated quadruped around a square, and its joints.

uv run --group bench python -m bench dog_picture      writes docs/how-to/dog-walk.png
"""

import math
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.robot.description import EXAMPLE, load_description
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig

TARGET = Path(__file__).parents[1] / "docs" / "how-to" / "dog-walk.png"
SIDE, SPEED, TURN = 1.0, 0.5, 0.8  # m, m/s, rad/s
WIDTH, HEIGHT, GAP = 1200, 560, 60
COLOURS = {"abad": "#1b7f3b", "hip": "#1f4fbf", "knee": "#c2410c"}
TRACED = ("FL_abad", "FL_hip", "FL_knee")


class RecordedWalk:
    """Recording of a walk: true positions, odometry positions, and joint angles over time."""

    def __init__(self):
        dog = load_description(EXAMPLE)
        self.rig = Rig(dog, MujocoWorld(dog))
        self.true, self.reported, self.joints = [], [], []
        self.rig.watch = self._see
        self.names = [joint.name for joint in dog.all_joints]

    def _see(self):
        state = self.rig.state()
        self.true.append(self.rig.sim.world.place()[:2])
        self.reported.append((state.x, state.y))
        self.joints.append((self.rig.sim.time, *state.angles))

    def square(self):
        """Stand up, walk around a square, and sit down."""
        self.rig.go(0.5)
        self.rig.request(BodyRequest.STAND)
        self.rig.go(2.5)
        for corner in range(1, 5):
            self._forward()
            self._turn(corner * math.pi / 2)
        self.rig.request(BodyRequest.SIT)
        self.rig.go(2.5)

    def _forward(self):
        begun = self.reported[-1]
        while math.dist(self.reported[-1], begun) < SIDE - 0.15:
            self.rig.go(0.05, Twist(SPEED))
        self.rig.go(1.0)

    def _turn(self, heading):
        while (left := math.remainder(heading - self.rig.sim.world.imu().rotation.yaw, math.tau)) > 0.02:
            self.rig.go(0.05, Twist(0, 0, min(TURN, 1.5 * left + 0.05)))
        self.rig.go(1.0)


class Panel:
    """A plot with axes, which maps data points to pixels."""

    def __init__(self, draw, box, low, high, title):
        self.draw, self.box, self.low, self.high = draw, box, low, high
        self.font = ImageFont.load_default(15)
        draw.rectangle(box, outline="#999999")
        draw.text((box[0], box[1] - 24), title, fill="black", font=self.font)

    def pixel(self, point):
        left, top, right, bottom = self.box
        x = left + (point[0] - self.low[0]) / (self.high[0] - self.low[0]) * (right - left)
        y = bottom - (point[1] - self.low[1]) / (self.high[1] - self.low[1]) * (bottom - top)
        return x, y

    def line(self, points, colour, width=2):
        self.draw.line([self.pixel(point) for point in points], fill=colour, width=width)

    def ticks(self, every, unit):
        for axis in (0, 1):
            first = math.ceil(self.low[axis] / every[axis])
            for number in range(first, math.floor(self.high[axis] / every[axis]) + 1):
                self._tick(axis, number * every[axis], unit[axis])

    def _tick(self, axis, value, unit):
        text = f"{value:g} {unit}"
        if axis == 0:
            x, _ = self.pixel((value, self.low[1]))
            self.draw.line([(x, self.box[1]), (x, self.box[3])], fill="#eeeeee")
            self.draw.text((x - 12, self.box[3] + 4), text, fill="#555555", font=self.font)
        else:
            _, y = self.pixel((self.low[0], value))
            self.draw.line([(self.box[0], y), (self.box[2], y)], fill="#eeeeee")
            self.draw.text((self.box[0] - 58, y - 9), text, fill="#555555", font=self.font)

    def legend(self, words):
        for number, (word, colour) in enumerate(words.items()):
            self.draw.text(
                (self.box[0] + 10 + 130 * number, self.box[1] + 6), word, fill=colour, font=self.font
            )


def path_panel(draw, walk):
    box = (GAP + 10, GAP, GAP + 10 + HEIGHT - 2 * GAP, HEIGHT - GAP)
    panel = Panel(draw, box, (-0.3, -0.3), (1.3, 1.3), "Path seen from above: a square of 1 m, 0.5 m/s")
    panel.ticks((0.5, 0.5), ("m", "m"))
    panel.line(walk.reported, "#c2410c", 1)
    panel.line(walk.true, "#1f4fbf", 2)
    panel.legend({"true path": "#1f4fbf", "odometry": "#c2410c"})


def joints_panel(draw, walk):
    left = HEIGHT + GAP + 20
    end = walk.joints[-1][0]
    panel = Panel(
        draw, (left, GAP, WIDTH - 20, HEIGHT - GAP), (0.0, -2.9), (end, 1.9), "Joints of the left front leg"
    )
    panel.ticks((5.0, 1.0), ("s", "rad"))
    for name in TRACED:
        number = walk.names.index(name) + 1
        panel.line([(row[0], row[number]) for row in walk.joints], COLOURS[name[3:]], 1)
    panel.legend({name: COLOURS[name[3:]] for name in TRACED})


def run():
    walk = RecordedWalk()
    walk.square()
    picture = Image.new("RGB", (WIDTH, HEIGHT), "white")
    draw = ImageDraw.Draw(picture)
    path_panel(draw, walk)
    joints_panel(draw, walk)
    picture.quantize(64).save(TARGET, optimize=True)
    off = math.dist(walk.true[0], walk.true[-1])
    size = TARGET.stat().st_size // 1024
    print(f"{TARGET.name}: {size} kB; it ended {off:.2f} m from its start and is {walk.rig.mode}")
