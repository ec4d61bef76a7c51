"""``fleet apply --fleet`` before anything is rolled out; the rest is in tests/system/test_rollout.py."""

import json

import pytest


@pytest.fixture
def site(fleet, place):
    fleet("bundle", "key", "site")
    for version in ("1", "2"):
        fleet("bundle", "make", "--key", "site.key", "--version", version, "-o", f"{version}.bundle")
    return place


def settings(site, **fields):
    (site / "rollout.yaml").write_text(
        json.dumps({"servers": ["nats://127.0.0.1:1"], "trust": ["site.pub"]} | fields)
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--fleet"], "--fleet needs the bundles"),
        (["--fleet", "--force", "1.bundle"], "--force is for one edge"),
        (["a.yaml", "b.yaml"], "several bundles need --fleet"),
    ],
)
def test_a_line_that_means_nothing_is_refused(fleet, place, options, words):
    refused = fleet("apply", *options)
    assert (refused.code, words in refused.err) == (2, True)


def test_bundles_must_be_signed_by_a_trusted_key_and_be_one_for_each_edge(fleet, site):
    settings(site, trust=[])
    assert "add  trust: [KEY.pub]" in fleet("apply", "--fleet", "1.bundle").err
    settings(site)
    assert "two bundles are for edge yard-1" in fleet("apply", "--fleet", "1.bundle", "2.bundle").err
    fleet("bundle", "key", "other")
    settings(site, trust=["other.pub"])
    assert "no trusted key signed the bundle" in fleet("apply", "--fleet", "1.bundle").err


def test_a_store_that_is_not_there_and_waves_that_mean_nothing_are_reported(fleet, site):
    settings(site)
    assert "'x' are no waves" in fleet("apply", "--fleet", "1.bundle", "--waves", "x").err
    assert "'x' is no limit" in fleet("apply", "--fleet", "1.bundle", "--stop-if", "x").err
    refused = fleet("apply", "--fleet", "1.bundle")
    assert (refused.code, "the store of roll-outs (nats://127.0.0.1:1) does not answer" in refused.err) == (
        1,
        True,
    )
