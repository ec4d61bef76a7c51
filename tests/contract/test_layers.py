"""Imports go downward only; nobody inside fleet imports its root."""

import ast
import re
import subprocess
import sys
from pathlib import Path


def test_every_import_contract_is_kept(root):
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]
    result = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout


def test_nobody_inside_fleet_imports_the_root(root):
    texts = {path: path.read_text() for path in (root / "fleet").rglob("*.py")}
    sources = {
        path: ast.parse(text)
        for path, text in texts.items()
        if re.search(r"import .*\bfleet\b|from fleet import", text)
    }
    found = [
        f"{path.relative_to(root)}:{node.lineno}"
        for path, tree in sources.items()
        for node in ast.walk(tree)
        if (isinstance(node, ast.Import) and any(name.name == "fleet" for name in node.names))
        or (isinstance(node, ast.ImportFrom) and node.module == "fleet" and node.level == 0)
    ]
    assert found == []
