"""Which frames of a vehicle are accepted, what is counted of the others, and how ours to it are made."""

import pytest

from fleet_mavlink.authentication import FALSE, UNSIGNED, FrameAuthentication
from fleet_mavlink.codec import PLAIN, Frame, Parser, pack
from fleet_mavlink.codec import FrameSettings as Settings
from fleet_mavlink.messages import Heartbeat, SystemTime
from fleet_mavlink.signing import Signer, key_of

NOW = 1_800_000_000.0
BEAT = Heartbeat(2, 3)


def signer(passphrase="correct horse"):
    return Signer(key_of(passphrase), lambda: NOW)


def beat(sender=None, *, version=2):
    """Return a heartbeat of system 7 as it is received, signed if its sender is given."""
    frame = pack(BEAT, 7, 1, 0, Settings(version=version, signer=sender))
    (received,) = Parser().feed(frame)
    return received


def test_without_a_key_every_frame_is_accepted_and_none_is_counted():
    trust = FrameAuthentication()
    assert trust.admits(beat())
    assert trust.admits(beat(signer("anybody's")))
    assert trust.counts == {}
    assert not trust.signed


def test_without_a_key_ours_are_made_in_the_version_of_the_newest_heartbeat():
    trust = FrameAuthentication()
    assert trust.frame_settings == PLAIN
    for version in (1, 2, 1):
        trust.admits(beat(version=version))
        assert (trust.frame_settings.version, trust.frame_settings.signer) == (version, None)


def test_only_a_heartbeat_tells_the_version():
    trust = FrameAuthentication()
    trust.admits(Frame(7, 1, SystemTime(1), version=1))
    assert trust.frame_settings.version == 2


def test_with_a_key_ours_are_signed_and_never_in_version_1():
    own = signer()
    trust = FrameAuthentication(own, accept_unsigned=True)
    trust.admits(beat(version=1))
    assert (trust.frame_settings.signer, trust.frame_settings.version) == (own, 2)


def test_a_frame_signed_with_the_key_is_accepted():
    trust = FrameAuthentication(signer())
    assert trust.admits(beat(signer()))
    assert trust.signed
    assert trust.counts == {}


@pytest.mark.parametrize("accept_unsigned", [True, False])
def test_a_frame_signed_with_another_key_is_never_accepted(accept_unsigned):
    trust = FrameAuthentication(signer(), accept_unsigned=accept_unsigned)
    assert not trust.admits(beat(signer("another key")))
    assert trust.counts == {FALSE: 1}
    assert not trust.signed


@pytest.mark.parametrize("accept_unsigned", [True, False])
def test_a_frame_that_is_sent_again_is_never_accepted(accept_unsigned):
    trust, frame = FrameAuthentication(signer(), accept_unsigned=accept_unsigned), beat(signer())
    assert trust.admits(frame)
    assert not trust.admits(frame)
    assert trust.counts == {FALSE: 1}


def test_unless_the_config_says_otherwise_an_unsigned_frame_is_refused():
    assert not FrameAuthentication(signer()).admits(beat())


def test_an_unsigned_frame_is_accepted_only_by_the_config_and_counted_in_any_case():
    for accepted in (True, False):
        trust = FrameAuthentication(signer(), accept_unsigned=accepted)
        assert [trust.admits(beat()) for _ in range(3)] == [accepted] * 3
        assert trust.counts == {UNSIGNED: 3}


def test_whether_it_signs_is_told_by_its_newest_accepted_frame():
    trust, sender = FrameAuthentication(signer(), accept_unsigned=True), signer()
    told = [trust.admits(frame) and trust.signed for frame in (beat(), beat(sender), beat(), beat(sender))]
    assert told == [False, True, False, True]


def test_each_kind_of_refusal_is_logged_once(caplog):
    trust, wrong = FrameAuthentication(signer()), signer("another key")
    for _ in range(3):
        trust.admits(beat())
        trust.admits(beat(wrong))
    assert caplog.messages == [
        "system 7 sends frames without a signature",
        "system 7 sends frames with a false or an old signature",
    ]
    assert trust.counts == {UNSIGNED: 3, FALSE: 3}
