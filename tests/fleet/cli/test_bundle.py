"""``fleet bundle``: keys, bundles, and the first one of an edge."""

import json

import pytest


@pytest.fixture
def keys(fleet, place):
    assert fleet("bundle", "key", "site").code == 0
    return place


def made(fleet, version="1", *options):
    into = f"{version}.bundle"
    return fleet("bundle", "make", "--key", "site.key", "--version", version, "-o", into, *options, "--json")


def test_a_key_is_ours_alone_and_never_written_over(fleet, keys):
    assert (keys / "site.key").stat().st_mode & 0o777 == 0o600
    again = fleet("bundle", "key", "site")
    assert (again.code, "site.key is there already" in again.err) == (1, True)


def test_a_bundle_is_made_and_checked_as_an_edge_does(fleet, keys):
    assert made(fleet).json["edges"] == ["yard-1"]
    shown = fleet("bundle", "show", "1.bundle", "--trust", "site.pub")
    assert "version 1" in shown.out
    fleet("bundle", "key", "other")
    refused = fleet("bundle", "show", "1.bundle", "--trust", "other.pub")
    assert (refused.code, "no trusted key signed the bundle" in refused.err) == (1, True)


def test_the_first_bundle_is_installed_once_and_for_its_edge_alone(fleet, keys):
    made(fleet)
    folder = keys / "edge"
    folder.mkdir()
    settings = {"servers": ["tls://a:4222"], "trust": [str(keys / "site.pub")], "edge": "yard-2"}
    (folder / "rollout.yaml").write_text(json.dumps(settings))
    refused = fleet("bundle", "install", "1.bundle", "--into", "edge")
    assert (refused.code, "is for yard-1, not for edge yard-2" in refused.err) == (1, True)
    (folder / "rollout.yaml").write_text(json.dumps(settings | {"edge": "yard-1"}))
    assert fleet("bundle", "install", "1.bundle", "--into", "edge").code == 0
    assert (folder / "current" / "fleet.yaml").read_text() == (keys / "fleet.yaml").read_text()
    again = fleet("bundle", "install", "1.bundle", "--into", "edge")
    assert (again.code, "roll out the next" in again.err) == (1, True)


def test_without_an_edge_or_a_key_it_says_what_to_do(fleet, keys):
    (keys / "edge").mkdir()
    (keys / "edge" / "rollout.yaml").write_text('{"servers": ["tls://a:4222"]}')
    made(fleet)
    assert "names no edge" in fleet("bundle", "install", "1.bundle", "--into", "edge").err
    assert "cannot read none.key" in fleet("bundle", "make", "--key", "none.key", "--version", "1").err
