"""Simulated planes, QuadPlanes and VTOLs: what real ones were seen to do, and their refusals."""

import pytest

ACCEPTED = 0


@pytest.fixture
def flying(flying_plane):
    return flying_plane


def test_a_plane_ignores_velocities(flying):
    flying.set_mode("GUIDED")
    flying.stream(3.0, 0.0)
    assert flying.body.speed > flying.body.slowest
