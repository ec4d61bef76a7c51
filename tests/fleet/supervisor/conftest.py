import tempfile
from pathlib import Path

import pytest


@pytest.fixture
def short_folder():
    """Return a folder with a short path, as the socket of a supervisor needs."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)
