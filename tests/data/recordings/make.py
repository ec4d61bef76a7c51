"""Makes the recordings of this folder: a real edge hears a recorded autopilot over UDP, and is recorded.

``python tests/data/recordings/make.py NAME SECONDS`` plays the first seconds of ../mavlink/NAME.tlog in real
time, and writes NAME.mcap. To be run on a computer that has nothing else to do.
"""

from __future__ import annotations

import importlib.util
import os
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).parent
FLIGHTS = HERE.parent / "mavlink"
PORT = 24550
FLEET = """
edge: {{id: yard}}
robots:
  - {{name: kestrel, twin: 6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f, adapter: mavlink, failsafes: ignore,
     link: "udpin:127.0.0.1:{port}"}}
"""
SETTLES = 4.0  # s until edge and recorder have found each other


def autopilot_frames(name, seconds):
    """Return (seconds, frame) of what the autopilot said first."""
    spec = importlib.util.spec_from_file_location("timelines", FLIGHTS / "timelines.py")
    timelines = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(timelines)
    found = [(at, frame) for at, frame in timelines.records(FLIGHTS / f"{name}.tlog")]
    begin = found[0][0]
    sender = {0xFE: 3, 0xFD: 5}
    return [
        (at - begin, frame) for at, frame in found if at - begin < seconds and frame[sender[frame[0]]] == 1
    ]


def called(environment, *arguments):
    """Run a command of fleet."""
    return subprocess.run(
        [sys.executable, "-m", "fleet", *arguments],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def main(name, seconds):
    """Record one flight."""
    frames = autopilot_frames(name, seconds)
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"FLEET_RUNTIME_DIR": f"{folder}/run", "XDG_STATE_HOME": f"{folder}/state"}
        environment["XDG_CACHE_HOME"] = f"{folder}/cache"
        fleet = Path(folder, "fleet.yaml")
        fleet.write_text(FLEET.format(port=PORT))
        recorded = f"{folder}/recorded"
        run = [sys.executable, "-m", "fleet"]
        recorder = subprocess.Popen([*run, "record", "--into", recorded], env=environment)
        edge = subprocess.Popen([*run, "run", str(fleet)], env=environment, stdout=subprocess.DEVNULL)
        while "kestrel" not in called(environment, "ps").stdout:
            time.sleep(0.5)
        time.sleep(SETTLES)
        called(
            environment, "send", "kestrel", "restart_adapter"
        )  # so that its link is opened in the recording
        time.sleep(SETTLES)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as autopilot:
            autopilot.connect(("127.0.0.1", PORT))
            began = time.monotonic()
            for at, frame in frames:
                time.sleep(max(0.0, began + at - time.monotonic()))
                autopilot.send(frame)
        time.sleep(1.0)
        for program in (edge, recorder):
            program.terminate()
            program.wait()
        into = HERE / f"{name}.mcap"
        into.unlink(missing_ok=True)
        subprocess.run([*run, "record", "export", str(into), "--from", recorded], check=True)


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
