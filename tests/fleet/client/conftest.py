"""Edges of toy robots, as the tests of the host have them."""

import importlib.util
from pathlib import Path

_PATH = Path(__file__).parents[1] / "host" / "conftest.py"
_SPEC = importlib.util.spec_from_file_location("host_fixtures", _PATH)
_HOST = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(_HOST)
yard, run_edge, requests = _HOST.yard, _HOST.run_edge, _HOST.requests
