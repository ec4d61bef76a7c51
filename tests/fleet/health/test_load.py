import threading

import psutil
import pytest

from fleet.health.load import read_load


def test_the_load_of_this_computer_is_read():
    load = read_load()
    memory = psutil.virtual_memory()
    assert load.load >= 0.0
    assert load.memory_percent == pytest.approx(100.0 * (1 - memory.available / memory.total), abs=10.0)
    assert load.memory_available_mb == pytest.approx(memory.available / 2**20, rel=0.3)
    assert load.threads == threading.active_count()


def test_what_cannot_be_read_is_unknown(tmp_path, monkeypatch):
    monkeypatch.setattr("fleet.health.load.MEMINFO", tmp_path / "none")
    monkeypatch.setattr("fleet.health.load.THERMAL", tmp_path / "none")
    load = read_load()
    assert (load.memory_percent, load.memory_available_mb, load.cpu_temperature) == (None, None, None)


@pytest.mark.parametrize(
    "text", ["", "MemTotal:\nMemAvailable:\n", "MemTotal:  \n", "MemTotal: 0 kB\n", "MemAvailable: 5 kB\n"]
)
def test_a_memory_file_of_another_form_is_unknown(tmp_path, monkeypatch, text):
    (tmp_path / "meminfo").write_text(text)
    monkeypatch.setattr("fleet.health.load.MEMINFO", tmp_path / "meminfo")
    assert read_load().memory_percent is None


@pytest.mark.parametrize(("text", "temperature"), [("41500\n", 41.5), ("", None), ("hot", None)])
def test_the_temperature_is_in_degrees(tmp_path, monkeypatch, text, temperature):
    (tmp_path / "temp").write_text(text)
    monkeypatch.setattr("fleet.health.load.THERMAL", tmp_path / "temp")
    assert read_load().cpu_temperature == temperature
