"""Which log `wayfi view` shows of a folder."""

from pathlib import Path

import pytest

from wayfi.backend.errors import WayfiError
from wayfi.recordings.rerun.viewer import find_log


def test_a_folder_stands_for_its_newest_log(tmp_path: Path) -> None:
    with pytest.raises(WayfiError, match="does not exist"):
        find_log(tmp_path / "nowhere")
    with pytest.raises(WayfiError, match="holds no session"):
        find_log(tmp_path)
    for name in ("session_1.rrd", "session_2.rrd"):
        (tmp_path / name).touch()
    assert find_log(tmp_path).name == "session_2.rrd"
    (tmp_path / "session.rrd").touch()
    assert find_log(tmp_path).name == "session.rrd"
    (tmp_path / "other.txt").touch()
    with pytest.raises(WayfiError, match=r"not an \.rrd"):
        find_log(tmp_path / "other.txt")
