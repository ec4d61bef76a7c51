"""The files of an edge's lasting state."""

from fleet.spool.database import open_checked


def test_a_file_is_made_for_its_user_alone_whoever_may_look_into_its_folder(tmp_path):
    tmp_path.chmod(0o755)
    connection, _ = open_checked(tmp_path / "spool.db", "CREATE TABLE kept (what TEXT)", 1, "NORMAL")
    connection.execute("INSERT INTO kept VALUES ('secret')")
    assert {path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {0o600}
    connection.close()
