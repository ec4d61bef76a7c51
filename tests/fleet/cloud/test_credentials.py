import re

import pytest
from cyberwave.config import resolve_mqtt_credentials

from fleet.cloud.credentials import PLACEHOLDER, client_id, credentials


@pytest.mark.parametrize("token", [None, "cw_token", "plain"])
@pytest.mark.parametrize("username", [PLACEHOLDER, "station"])
@pytest.mark.parametrize("password", [None, "cw_other", "secret"])
def test_the_broker_sees_what_the_published_sdk_sends(token, username, password):
    expected = resolve_mqtt_credentials(username, password, token)
    found = credentials(token, username, password)
    assert (found and (found.username, found.password)) == (expected if expected[1] else None)


def test_a_password_is_not_shown():
    assert "cw_token" not in repr(credentials("cw_token"))


def test_every_client_id_is_new_and_says_whether_it_is_simulated():
    assert re.fullmatch(r"fleet_live_[0-9a-f]{32}", client_id("fleet", simulated=False))
    assert re.fullmatch(r"fleet_sim_[0-9a-f]{32}", client_id("fleet", simulated=True))
    assert client_id("fleet", simulated=True) != client_id("fleet", simulated=True)
