"""run.py, the way in for a computer that has only git and Python."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize("words", [[], ["fly"]])
def test_an_unknown_word_is_answered_with_how_to_use_it(root, words):
    told = subprocess.run(
        [sys.executable, str(root / "run.py"), *words], capture_output=True, text=True, check=False, cwd="/"
    )
    assert told.returncode == 2
    assert "python3 run.py demo" in told.stderr
    assert "Traceback" not in told.stderr


@pytest.mark.parametrize("word", ["-h", "--help"])
def test_help_is_given(bootstrap, capsys, word):
    bootstrap.start([word])
    assert "python3 run.py demo" in capsys.readouterr().out


def test_the_users_own_uv_is_used(bootstrap, tmp_path, monkeypatch):
    uv = program(tmp_path / "uv", "echo uv 0.9.1")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert bootstrap.find_uv() == uv


@pytest.mark.parametrize("script", ["echo uv 0.4.9", "echo 'uv: command not found'; exit 127"])
def test_a_uv_that_is_too_old_or_broken_is_passed_over(bootstrap, tmp_path, script):
    assert not bootstrap.works(program(tmp_path / "uv", script))


def test_a_python_without_pip_makes_its_uv_with_a_pip_that_is_not_installed(bootstrap, tmp_path, monkeypatch):
    steps = []
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(bootstrap, "OWN_UV", tmp_path / ".venv-uv")
    monkeypatch.setattr(bootstrap.importlib.util, "find_spec", lambda _: None)
    monkeypatch.setattr(bootstrap, "fetch_pip", lambda: tmp_path / "pip.whl")
    monkeypatch.setattr(bootstrap, "run", lambda command, advice: steps.append(command))
    assert bootstrap.find_uv() == tmp_path / ".venv-uv" / "bin" / "uv"
    target = ["install", "--root-user-action=ignore", "--target", str(tmp_path / ".venv-uv"), "--quiet", "uv"]
    assert steps == [[sys.executable, str(tmp_path / "pip.whl" / "pip"), *target]]


def test_a_python_that_is_too_old_is_told(bootstrap, monkeypatch):
    monkeypatch.setattr(bootstrap, "OLDEST_PYTHON", (99, 0))
    with pytest.raises(bootstrap.Impossible, match=r"at least 3\.11 is needed"):
        bootstrap.start(["demo"])


def test_a_failing_step_ends_with_its_advice(bootstrap):
    with pytest.raises(bootstrap.Impossible, match="do this"):
        bootstrap.run(["false"], "do this")


def program(path, script):
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return path
