"""Passwords: kept as argon2id, the same work for nobody, the same password from every keyboard."""

from fleet.console import passwords
from fleet.console.passwords import LONGEST, SHORTEST, hash_password, password_problem, verify_password

RIGHT = "correct horse battery"


def test_a_password_is_kept_as_argon2id_with_a_salt_and_known_again():
    kept = hash_password(RIGHT)
    assert kept.startswith("$argon2id$v=19$m=65536,t=3,p=1$")
    assert RIGHT not in kept
    assert verify_password(kept, RIGHT)
    assert not verify_password(kept, "another horse battery")


def test_nobody_costs_the_same_work_and_is_refused(monkeypatch):
    done = []
    hasher = passwords._hasher

    class Counting:
        def verify(self, kept, password):
            done.append(kept)
            return hasher.verify(kept, password)

        hash = staticmethod(hasher.hash)

    monkeypatch.setattr(passwords, "_hasher", Counting())
    assert not verify_password(None, RIGHT)
    assert not verify_password(None, "nobody has this password")
    assert [kept.rsplit("$", 2)[0] for kept in done] == ["$argon2id$v=19$m=65536,t=3,p=1"] * 2


def test_a_damaged_hash_is_no_password():
    assert not verify_password("$argon2id$v=19$garbage", RIGHT)
    assert not verify_password("", "")


def test_composed_letters_are_the_same_from_every_keyboard():
    assert verify_password(hash_password("Brückenpfeiler"), "Bru\u0308ckenpfeiler")


def test_passwords_have_a_length():
    assert "at least 12" in password_problem("x" * (SHORTEST - 1))
    assert "at most" in password_problem("x" * (LONGEST + 1))
    assert password_problem("x" * SHORTEST) == ""
