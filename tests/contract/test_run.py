"""run.py, the way in for a computer that has only git and Python."""

import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule


@pytest.mark.parametrize("words", [[], ["fly"]])
def test_an_unknown_word_is_answered_with_how_to_use_it(root, words):
    result = subprocess.run(
        [sys.executable, str(root / "run.py"), *words], capture_output=True, text=True, check=False, cwd="/"
    )
    assert result.returncode == 2
    assert "python3 run.py demo" in result.stderr
    assert "Traceback" not in result.stderr


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


def test_a_python_that_is_too_old_is_reported(bootstrap, monkeypatch):
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


def test_the_fast_tier_names_folders_and_files_that_are_there(root, module_at):
    tiers = module_at("tiers.py")
    assert [name for name in (*tiers.FAST, *tiers.BUT) if not (root / "tests" / name).exists()] == []
    assert all(any(name.startswith(f"{fast}/") for fast in tiers.FAST) for name in tiers.BUT)


@pytest.mark.parametrize(
    ("option", "pytests"), [("--fast", ["--fast"]), ("--soak", ["--soak", "--timeout", "0"])]
)
def test_the_tiers_are_options_of_run_py_test(bootstrap, monkeypatch, option, pytests):
    started = []
    monkeypatch.setattr(bootstrap, "install", lambda word: None)
    monkeypatch.setattr(bootstrap, "fetch_programs", lambda: None)
    monkeypatch.setattr(bootstrap.os, "chdir", lambda folder: None)
    monkeypatch.setattr(bootstrap.os, "execv", lambda program, arguments: started.extend(arguments))
    bootstrap.start(["test", option, "tests/fleet/wire"])
    assert started[-len(pytests) - 1 :] == [*pytests, "tests/fleet/wire"]


def test_a_test_of_the_fast_tier_that_waits_fails(root, tmp_path):
    test = root / "tests" / "fleet" / "wire" / "test_that_waits.py"
    test.write_text("import socket\ndef test_waits():\n    socket.create_server(('127.0.0.1', 0)).close()\n")
    try:
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "--fast", "-p", "no:cacheprovider", str(test)],
            capture_output=True,
            text=True,
            check=False,
            cwd=root,
        )
    finally:
        test.unlink()
    assert "the fast tier waits for nothing: mark this test waits" in done.stdout


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("x" * 100, None),
        (10**1000, None),
        ("x" * 101, f"'{'x' * 50}' and 51 more"),
        (b"x" * 101, f"b'{'x' * 50}' and 51 more"),
    ],
    ids=["short", "number", "text", "bytes"],
)
def test_a_long_parameter_is_shortened_in_the_name_of_its_test(module_at, value, shown):
    assert module_at("tiers.py").pytest_make_parametrize_id(value) == shown


@pytest.mark.parametrize(("factor", "count"), [(50, 350), (0.2, 1)])
def test_a_tier_has_its_own_number_of_examples(module_at, factor, count):
    @settings(max_examples=7, deadline=None)
    @given(st.integers())
    def counted(_number):
        counts.append(1)

    counts = []
    module_at("tiers.py").scale_examples(counted, factor)
    counted()
    assert len(counts) == count


@pytest.mark.parametrize(("factor", "count"), [(50, 350), (0.2, 1)])
def test_a_tier_has_its_own_number_of_examples_of_a_state_machine(module_at, factor, count):
    class Counted(RuleBasedStateMachine):
        @initialize()
        def count(self):
            counts.append(1)

        @rule(number=st.integers())
        def rest(self, number):
            pass

    counts, case = [], Counted.TestCase
    case.settings = settings(max_examples=7, stateful_step_count=2, deadline=None)
    module_at("tiers.py").scale_state_machine(case, factor)
    case("runTest").runTest()
    assert len(counts) == count


@pytest.mark.combinations
@pytest.mark.parametrize("name", ["one", "two", "three"])
@pytest.mark.parametrize("number", [1, 2])
def test_each_value_is_in_every_run_and_each_combination_in_the_soak(name, number, request, pytestconfig):
    tests = [each for each in request.session.items if each.originalname == request.node.originalname]
    tried = [(each.callspec.params["name"], each.callspec.params["number"]) for each in tests]
    assert (name, number) in tried
    assert len(tried) <= (6 if pytestconfig.getoption("--soak") else 3)  # fewer where one is chosen by name
