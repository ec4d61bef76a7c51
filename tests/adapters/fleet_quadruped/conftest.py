import pytest

from fleet_quadruped.robot.description import EXAMPLE, load_description
from fleet_quadruped.sim.rig import Rig


def speaking(dog, protocol, profile="damiao-8006"):
    """Return the same dog with other drives."""
    drive = dog.drive.model_copy(update={"protocol": protocol, "profile": profile})
    return dog.model_copy(update={"drive": drive})


@pytest.fixture(scope="session")
def dog():
    return load_description(EXAMPLE)


@pytest.fixture(params=["cia402", "mit"])
def any_dog(dog, request):
    """Return the example dog with each kind of drives."""
    return speaking(dog, request.param)


@pytest.fixture(scope="session")
def mit_dog(dog):
    return speaking(dog, "mit")


@pytest.fixture
def rig(any_dog):
    """Return a kinematic dog, off, with each kind of drives."""
    return Rig(any_dog)


@pytest.fixture
def standing(rig):
    """Return a kinematic dog that stands."""
    rig.stand()
    return rig


@pytest.fixture
def write_dog(tmp_path):
    """Write the example description with replaced text; return its path."""

    def write(*changes):
        text = EXAMPLE.read_text()
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new)
        path = tmp_path / "dog.yaml"
        path.write_text(text)
        return path

    return write
