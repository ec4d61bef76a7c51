"""Writes docs/reference/mission-grammar.md from the models of missions; run it after changing one.

python docs/reference/make_mission_reference.py
"""  # noqa: INP001 - a script beside its result

from __future__ import annotations

import pathlib
import runpy

from fleet.missions import model

HERE = pathlib.Path(__file__)
TARGET = HERE.with_name("mission-grammar.md")
INTRODUCTION = """\
# The grammar of missions

Made from the models by `docs/reference/make_mission_reference.py`; do not edit. Begin with
[missions](../how-to/missions.md).

- A duration is a number with its unit: `60 s`, `12 min`, `1 h`.
- `{input: NAME}` stands for the whole value of an input, anywhere in the mission.
- `eye: land` is short for `eye: {command: land}`; `count: 2` for `count: {min: 2, max: 2}`.
- `all`, in the place of a role, is every robot of the run.
"""
MODELS = (
    model.MissionConfig,
    model.InputConfig,
    model.RoleConfig,
    model.CountConfig,
    model.RequireConfig,
    model.BatteryConfig,
    model.StepConfig,
    model.ActConfig,
    model.ConditionConfig,
    model.WaitForConfig,
    model.AskConfig,
    model.RepeatConfig,
    model.RobotFailedConfig,
)


def render() -> str:
    """Return the whole reference."""
    section = runpy.run_path(str(HERE.with_name("make_config_reference.py")))["section"]
    lines = [INTRODUCTION.rstrip()]
    for each in MODELS:
        lines += section(each.__name__, each)
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    TARGET.write_text(render(), encoding="utf-8")
