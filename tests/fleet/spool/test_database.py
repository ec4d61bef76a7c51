"""The files of an edge's lasting state."""

import sqlite3

import pytest

from fleet.spool.database import CACHE, open_checked, transaction


def test_a_file_is_made_for_its_user_alone_whoever_may_look_into_its_folder(tmp_path):
    tmp_path.chmod(0o755)
    connection, _ = open_checked(tmp_path / "spool.db", ["CREATE TABLE kept (what TEXT)"], "NORMAL")
    connection.execute("INSERT INTO kept VALUES ('secret')")
    assert {path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {0o600}
    connection.close()


def test_a_file_of_an_older_format_is_brought_to_the_newest_and_keeps_what_it_holds(tmp_path):
    formats = ["CREATE TABLE kept (what TEXT)"]
    connection, _ = open_checked(tmp_path / "spool.db", formats, "NORMAL")
    connection.execute("INSERT INTO kept VALUES ('old')")
    connection.close()
    formats += ["ALTER TABLE kept ADD COLUMN why TEXT DEFAULT ''", "UPDATE kept SET why = 'moved'"]
    for _ in range(2):
        connection, aside = open_checked(tmp_path / "spool.db", formats, "NORMAL")
        assert aside is None
        assert connection.execute("SELECT * FROM kept").fetchall() == [("old", "moved")]
        assert connection.execute("PRAGMA user_version").fetchone() == (3,)
        connection.close()


def test_a_file_that_grows_takes_no_more_memory(tmp_path):
    connection, _ = open_checked(tmp_path / "spool.db", ["CREATE TABLE kept (what TEXT)"], "NORMAL")
    assert connection.execute("PRAGMA cache_size").fetchone() == (-CACHE,)
    connection.close()


@pytest.mark.parametrize("statement", ["INSERT INTO part VALUES (1)", "INSERT INTO nothing VALUES (1)"])
def test_a_transaction_that_fails_leaves_nothing_and_lets_the_next_begin(tmp_path, statement):
    """A constraint that is checked at the commit makes the commit itself fail."""
    whole = "CREATE TABLE whole (id INTEGER PRIMARY KEY)"
    part = "CREATE TABLE part (whole REFERENCES whole DEFERRABLE INITIALLY DEFERRED)"
    database, _ = open_checked(tmp_path / "file.db", [whole, part], "NORMAL")
    database.execute("PRAGMA foreign_keys = ON")

    def write():
        with transaction(database):
            database.execute("INSERT INTO whole VALUES (7)")
            database.execute(statement)

    with pytest.raises(sqlite3.Error):
        write()
    with transaction(database):
        assert database.execute("SELECT * FROM whole").fetchall() == []
    database.close()
