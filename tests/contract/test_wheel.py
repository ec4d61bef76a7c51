"""What the wheel puts on other people's computers."""

import subprocess
import zipfile

import pytest

pytestmark = pytest.mark.xdist_group("wheel")


@pytest.fixture(scope="module")
def shipped(root, bootstrap, tmp_path_factory):
    """Build the wheel and return the paths in it."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [str(bootstrap.find_uv()), "build", "--wheel", "--offline", "--out-dir", str(folder)]
    result = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    (wheel,) = folder.glob("*.whl")
    return zipfile.ZipFile(wheel).namelist()


def test_the_wheel_installs_fleet_and_its_adapters_only(root, shipped):
    tops = {path.partition("/")[0] for path in shipped}
    adapters = {path.name for path in (root / "adapters").glob("fleet_*")}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"fleet"} | adapters


def test_the_wheel_says_that_it_is_typed(shipped):
    assert {"fleet/py.typed", "fleet_mavlink/py.typed"} <= set(shipped)


def test_the_wheel_holds_what_adapter_authors_test_with(root, shipped):
    held = {path.rpartition("/")[2] for path in shipped if path.startswith("fleet/testing/")}
    assert {"bench.py", "contract.py", "robot.py", "wires.py"} <= held
    assert held == {path.name for path in (root / "fleet" / "testing").glob("*.py")}


def test_the_wheel_holds_the_page_of_the_console(root, shipped):
    page = {path.relative_to(root).as_posix() for path in (root / "fleet/console/static").rglob("*.*")}
    assert "fleet/console/static/index.html" in page
    assert page <= set(shipped)


def test_the_wheel_carries_the_licence(shipped):
    assert any(path.endswith(".dist-info/licenses/LICENSE") for path in shipped)
