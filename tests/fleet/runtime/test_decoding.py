"""Decoding on several threads at once."""

import subprocess
import sys

import msgspec
import pytest

from fleet.runtime.decoding import decode_json

FROM_MANY_THREADS = """
import sys, threading, msgspec
from fleet.runtime.decoding import convert_strictly, decode_json

class Inner(msgspec.Struct):
    a: int = 0
    b: list[str] = []

class Outer(msgspec.Struct):
    x: Inner
    y: list[Inner]

sys.setswitchinterval(0.0001)
together = threading.Barrier(6)
def decode():
    together.wait()
    decode_json(b'{"x": {"a": 1}, "y": [{"b": ["s"]}]}', Outer)
    convert_strictly({"x": {"a": 1}, "y": []}, Outer)
for _ in range(6):
    threading.Thread(target=decode).start()
"""


@pytest.mark.parametrize("attempt", range(12))
def test_a_type_that_many_threads_decode_first_ends_no_process(attempt):
    ended = subprocess.run([sys.executable, "-c", FROM_MANY_THREADS], capture_output=True, check=False)
    assert ended.returncode == 0, ended


@pytest.mark.parametrize("data", [b'{"a": "\xff"}', b'{"\xff": 1}', b'{"a": "\xe9t\xe9"}', b"\xff", b"{"])
def test_whatever_bytes_come_there_is_one_kind_of_error(data):
    with pytest.raises(msgspec.DecodeError):
        decode_json(data, dict)
