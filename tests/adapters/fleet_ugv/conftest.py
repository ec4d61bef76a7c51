import pytest

from fleet_ugv import UgvConfig

TWIN = "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"


def config_of(profile="waveshare-beast", link="memory:beast", **fields):
    basics = {"name": "beast", "twin": TWIN, "adapter": "ugv"}
    return UgvConfig(**basics | {"profile": profile, "link": link} | fields)


@pytest.fixture
def make_config():
    return config_of
