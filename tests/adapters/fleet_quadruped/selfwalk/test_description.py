import pytest

from fleet.errors import ConfigError
from fleet_quadruped.any_description import load_body
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.safety.stages import BodyMode

OWN = EXAMPLE.with_name("self-walking.yaml")
CANOPEN = EXAMPLE.with_name("self-walking-canopen.yaml")


@pytest.fixture
def write(tmp_path):
    """Write an example with replaced text; return its path."""

    def _write(example, old, new):
        text = example.read_text()
        assert old in text
        path = tmp_path / "walker.yaml"
        path.write_text(text.replace(old, new))
        return path

    return _write


@pytest.mark.parametrize(
    ("example", "old", "new", "expected"),
    [
        (OWN, "silence: 0.3 ", "# ", "silence: Field required"),
        (OWN, "silence: 0.3", "silence: 0.05", "less than three cycles"),
        (OWN, "mode: {at: 0, type: u8}", "other: {at: 0, type: u8}", "it must report mode"),
        (OWN, "2: standing, ", "", "no number means standing"),
        (
            OWN,
            "turn: {at: 2, type: i16, endian: big, scale: 0.001}",
            "",
            "a velocity has the fields x, y, turn",
        ),
        (OWN, "  stand_up:", "  # stand_up:", "frames.stand_up: Field required"),
        (OWN, "bitrate: 500000", "bitrate: 5000", "more than 60%"),
        (OWN, "height: 0.3\n", "height: 0.5\n", "not between lowest and highest"),
        (OWN, "led: {bus: a", "led: {bus: z", "there is no bus 'z'"),
        (CANOPEN, "    y: {index: 0x2100", "    z: {index: 0x2100", "a velocity has the entries"),
        (CANOPEN, "type: i16, scale: 3.05", "type: f32, scale: 3.05", "do not fit into 4 PDOs"),
        (CANOPEN, "objects:", "frames: null\nobject:", "object: unknown key, did you mean"),
    ],
)
def test_what_cannot_be_walked_with_is_refused(write, example, old, new, expected):
    with pytest.raises(ConfigError, match=r"walker\.yaml") as refused:
        load_body(write(example, old, new))
    assert expected in str(refused.value)


def test_a_bare_off_of_yaml_is_the_mode_off(write):
    assert load_body(write(OWN, '0: "off"', "0: off")).modes[0] is BodyMode.OFF
