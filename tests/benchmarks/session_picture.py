"""Makes a picture of a log as the viewer shows it, such as that of the README, without a screen.

python tests/benchmarks/session_picture.py SESSION.rrd PICTURE.png [STAMP_NS]; it needs a Vulkan driver (Debian:
mesa-vulkan-drivers).
"""

import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image
from rerun.experimental import ViewerClient

from wayfi.recordings.rerun.viewer_process import HOST, ViewerError, free_port, viewer_process

SIZE = "1600x1000"
TRIES, PAUSE_S = 150, 0.2
SETTLE_S = 7.0  # until the first notices are gone and everything is drawn
COLORS = 256
SOFTWARE_VULKAN = Path("/usr/share/vulkan/icd.d/lvp_icd.x86_64.json")


def picture(rrd: Path, png: Path, stamp_ns: int | None = None) -> None:
    """Writes `png`, 1600 x 1000 pixels: what the viewer shows of `rrd` at `stamp_ns`, or at its end.

    Raises ViewerError if the viewer does not start or draw.
    """
    port = free_port()
    arguments = ["--headless", "--window-size", SIZE, "--hide-welcome-screen", "--port", str(port), str(rrd)]
    environment = {"VK_ICD_FILENAMES": str(SOFTWARE_VULKAN)} if SOFTWARE_VULKAN.exists() else {}
    with TemporaryDirectory() as folder, viewer_process(arguments, environment) as process:
        raw = Path(folder) / "picture.png"
        viewer = _connected(port, process, rrd)
        if stamp_ns is not None:
            viewer.set_time("stamp", timestamp=np.datetime64(stamp_ns, "ns"), play_state="paused")
        viewer.save_screenshot(str(raw))  # starts the loading of what is visible
        time.sleep(SETTLE_S)
        viewer.save_screenshot(str(raw))
        with Image.open(raw) as image:
            palette = image.convert("RGB").quantize(COLORS, dither=Image.Dither.NONE)
            palette.save(png, optimize=True)


def _connected(port: int, process: "subprocess.Popen[bytes]", rrd: Path) -> ViewerClient:
    """A client of the viewer, once the log is loaded."""
    for _ in range(TRIES):
        if process.poll() is not None:
            break
        time.sleep(PAUSE_S)
        try:
            viewer = ViewerClient.connect(f"rerun+http://{HOST}:{port}/proxy")
            state = viewer.get_state()
        except (ConnectionError, OSError, RuntimeError):
            continue
        if state.recordings and not state.loading:
            return viewer
    raise ViewerError(f"the headless viewer did not show {rrd}: is a Vulkan driver installed (mesa-vulkan-drivers)?")


if __name__ == "__main__":
    picture(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else None)
