"""What a ``sim:`` link may say."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_mavlink.sim.spec import VehicleSpec, spec_of


def test_a_bare_link_is_ready_after_3_seconds():
    spec = VehicleSpec.parse("sim:px4")
    assert (spec.flavour, spec.ready, spec.speed, spec.system_id) == ("px4", 3.0, 1.0, 1)


def test_everything_can_be_said():
    options = "home=47.39,8.54,488,90&ready=real&speed=5&fault=loss:0.01,wind:3&seed=4&with=gimbal,adsb"
    spec = VehicleSpec.parse(f"sim:ardupilot?{options}", system_id=7)
    assert spec == VehicleSpec(
        "ardupilot",
        system_id=7,
        home=(47.39, 8.54, 488.0, 90.0),
        ready=None,
        speed=5.0,
        faults={"loss": 0.01, "wind": 3.0},
        seed=4,
        accessories=("gimbal", "adsb"),
    )


@pytest.mark.parametrize(
    ("link", "says"),
    [
        ("sim:rover", "no simulated vehicle"),
        ("udpout:1.2.3.4:5", "no simulated vehicle"),
        ("sim:px4?hom=1,2,3", "no option 'hom'"),
        ("sim:px4?home=1,2", "LATITUDE,LONGITUDE"),
        ("sim:px4?home=95,2,3,4", "not on Earth"),
        ("sim:px4?home=a,2,3,4", "'a' is not a number"),
        ("sim:px4?speed=0", "not 0.01 to 100"),
        ("sim:px4?speed=nan", "not a number"),
        ("sim:px4?ready=-1", "not 0 to 3600"),
        ("sim:px4?fault=los:1", "did you mean 'loss'"),
        ("sim:px4?fault=loss:2", "fault loss: 2"),
        ("sim:px4?with=laser", "simulated vehicle"),
        ("sim:px4?seed=x", "seed"),
        ("sim:px4?seed=inf", "seed"),
        ("sim:px4?speed", "name=value"),
        ("sim:px4?speed=1&speed=2", "twice"),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_reason(link, says):
    with pytest.raises(ValueError, match=says):
        VehicleSpec.parse(link)


@given(st.text())
def test_any_text_is_a_spec_or_a_value_error(text):
    try:
        spec = VehicleSpec.parse(f"sim:px4?{text}")
    except ValueError:
        return
    assert spec.flavour == "px4"


def test_a_system_id_outside_the_protocol_is_refused():
    with pytest.raises(ValueError, match="system id 255"):
        spec_of({"flavour": "px4", "system_id": 255})
