"""Archives: whole or not at all, and nothing believed that comes from outside."""

import io
import tarfile

import msgspec
import pytest

from fleet.backup.archive import FORMAT, BackupError, Manifest, entry_of, read_archive, write_archive

CONTENTS = {"state/journal.db": b"stops", "config/fleet.yaml": b"edge: {id: yard-1}\n"}


def manifest(contents, **more):
    files = {name: entry_of(content) for name, content in contents.items()}
    return Manifest(
        **{"format": FORMAT, "edge": "yard-1", "version": "1.0", "made": 1e9, "files": files} | more
    )


def test_what_is_written_is_read_again_and_nobody_else_may_read_it(tmp_path):
    path = tmp_path / "a.backup"
    write_archive(path, manifest(CONTENTS), CONTENTS)
    assert read_archive(path) == (manifest(CONTENTS), CONTENTS)
    assert path.stat().st_mode & 0o777 == 0o600
    assert [each.name for each in tmp_path.iterdir()] == ["a.backup"]


def test_another_file_is_never_overwritten(tmp_path):
    (tmp_path / "a.backup").write_text("mine")
    with pytest.raises(BackupError, match="exists already"):
        write_archive(tmp_path / "a.backup", manifest(CONTENTS), CONTENTS)
    assert (tmp_path / "a.backup").read_text() == "mine"


def forged(path, described, members):
    """Write an archive that fleet would not."""
    with tarfile.open(path, "w:gz") as archive:
        for name, content, kind in [("manifest.json", msgspec.json.encode(described), None), *members]:
            info = tarfile.TarInfo(name)
            info.size = len(content)
            if kind is not None:
                info.type, info.linkname, info.size = kind, "/etc/passwd", 0
            archive.addfile(info, io.BytesIO(content))
    return path


@pytest.mark.parametrize(
    ("contents", "members", "words"),
    [
        ({"state/a": b"1"}, [("state/a", b"2", None)], "SHA-256"),
        ({"state/a": b"1"}, [("state/a", b"12", None)], "size"),
        ({"state/a": b"1"}, [], "no complete backup"),
        ({"state/a": b"1"}, [("state/a", b"", tarfile.SYMTYPE)], "size"),
        ({}, [("state/b", b"1", None)], "not in its manifest"),
        ({"../../etc/passwd": b"1"}, [("../../etc/passwd", b"1", None)], "no name of a file"),
        ({"/etc/passwd": b"1"}, [("/etc/passwd", b"1", None)], "no name of a file"),
        ({"state/../x": b"1"}, [("state/../x", b"1", None)], "no name of a file"),
        ({"other/x": b"1"}, [("other/x", b"1", None)], "no name of a file"),
    ],
)
def test_an_archive_that_was_changed_is_refused(tmp_path, contents, members, words):
    with pytest.raises(BackupError, match=words):
        read_archive(forged(tmp_path / "a", manifest(contents), members))


def test_an_archive_of_a_newer_fleet_is_refused_with_its_version(tmp_path):
    with pytest.raises(BackupError, match=r"newer fleet \(9\.0\)"):
        read_archive(forged(tmp_path / "a", manifest({}, format=FORMAT + 1, version="9.0"), []))


@pytest.mark.parametrize("content", [b"", b"no archive", b"\x1f\x8b" + b"\0" * 50])
def test_what_is_no_archive_is_refused(tmp_path, content):
    (tmp_path / "a").write_bytes(content)
    with pytest.raises(BackupError, match=r"no (complete backup|backup of fleet)"):
        read_archive(tmp_path / "a")


def test_a_half_of_an_archive_is_refused(tmp_path):
    whole = tmp_path / "a.backup"
    contents = {"state/journal.db": bytes(range(256)) * 400}
    write_archive(whole, manifest(contents), contents)
    (tmp_path / "half").write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    with pytest.raises(BackupError):
        read_archive(tmp_path / "half")
