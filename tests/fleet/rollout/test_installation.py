"""Folder of an edge with bundles: one bundle or the other, never a mixture."""

import json

import msgspec
import pytest

from fleet.errors import StateError, StateNewer, StateTaken
from fleet.rollout.bundle import sign_bundle
from fleet.rollout.decision import AgentRecord
from fleet.rollout.faults import PartFault
from fleet.rollout.installation import STATE, Installation
from fleet.rollout.messages import BundleStage
from fleet.rollout.signature import new_key
from tests.tools.rollout import bundle_of

KEY = new_key()


@pytest.fixture
def installation(tmp_path):
    return Installation(tmp_path)


def staged(installation, version, **files):
    bundle = bundle_of(version, **files)
    address, _ = sign_bundle(bundle, KEY)
    installation.stage(bundle, address)
    return address


def test_a_staged_bundle_is_in_use_only_once_it_is_activated(installation):
    first = staged(installation, 1)
    assert installation.current == ""
    installation.activate(first)
    second = staged(installation, 2)
    assert (installation.current, installation.file_in_use.read_text()) == (first, "version 1 ")
    installation.activate(second)
    assert installation.file_in_use.read_text() == "version 2 "


def test_the_edges_own_secrets_are_beside_every_bundle(installation):
    (installation.folder / "secrets.yaml").write_text("token: x")
    installation.activate(staged(installation, 1, **{"plugins/a.py": b"x = 1"}))
    assert (installation.file_in_use.parent / "secrets.yaml").read_text() == "token: x"
    assert (installation.file_in_use.parent / "plugins" / "a.py").read_bytes() == b"x = 1"


def test_a_disk_that_fails_while_files_are_written_leaves_the_bundle_in_use(installation, monkeypatch):
    first = staged(installation, 1)
    installation.activate(first)

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("os.fsync", full)
        with pytest.raises(StateError, match="No space left on device"):
            staged(installation, 2)
    assert installation.current == first
    names = [path.name for path in (installation.folder / "versions").iterdir()]
    assert first in names
    installation.remove_unused()
    assert [path.name for path in (installation.folder / "versions").iterdir()] == [first]


def test_a_bundle_in_use_is_never_overwritten(installation):
    first = staged(installation, 1)
    installation.activate(first)
    installation.file_in_use.write_text("changed by hand")
    staged(installation, 1)
    assert installation.file_in_use.read_text() == "changed by hand"


def test_the_previous_bundle_is_kept_while_a_new_one_waits(installation):
    first, second = staged(installation, 1), staged(installation, 2)
    installation.save_record(AgentRecord(running=first, bundle=second, stage=BundleStage.WAITING))
    installation.activate(second)
    (installation.folder_of(first) / "fleet.yaml").write_text("changed by hand")
    staged(installation, 1)
    staged(installation, 3)
    installation.remove_unused()
    assert (installation.folder_of(first) / "fleet.yaml").read_text() == "changed by hand"
    assert {path.name for path in (installation.folder / "versions").iterdir()} == {first, second}


def test_the_record_is_the_same_after_a_restart(installation):
    record = AgentRecord("a", 3, "b", "r1", "b", "alice", BundleStage.WAITING, files=("rex.yaml",))
    installation.save_record(record)
    assert Installation(installation.folder).record() == record


def test_the_previous_version_reads_the_record_and_vice_versa(installation):
    class Before(msgspec.Struct, frozen=True):
        """Fields that the previous version reads."""

        bundle: str = ""
        health: str = ""
        format: int = 1

    installation.save_record(
        AgentRecord(bundle="b", health="ok", faults=(PartFault("rex", "fault", "motor 3"),))
    )
    data = (installation.folder / STATE).read_bytes()
    assert msgspec.json.decode(data, type=Before) == Before("b", "ok", 1)
    (installation.folder / STATE).write_bytes(msgspec.json.encode(Before("b", "ok")))
    assert installation.record() == AgentRecord(bundle="b", health="ok", faults=None)


@pytest.mark.parametrize("text", ["", "{", '{"highest": "x"}', "\udc80"])
def test_a_damaged_record_is_refused_because_an_older_bundle_could_pass(installation, text):
    (installation.folder / STATE).write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(StateError, match="an older bundle could pass"):
        installation.record()


def test_the_record_of_a_newer_version_is_refused(installation):
    (installation.folder / STATE).write_text(json.dumps({"format": 2}))
    with pytest.raises(StateNewer, match="format 2"):
        installation.record()


def test_only_one_process_can_lock_the_folder(installation):
    installation.lock()
    with pytest.raises(StateTaken):
        Installation(installation.folder).lock()
    installation.release()
    Installation(installation.folder).lock()
