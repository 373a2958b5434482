from pathlib import Path

import pytest

from wayfi.service.config import ZenohConfig
from wayfi.service.fleet.keys import keyframes_key, robot_and_run
from wayfi.service.fleet.robot_folders import ROBOTS, mirrored, robot_folder


@pytest.mark.parametrize("robot", ["", "robot1", "hall/robot 1", "../../etc", ".", "..", "_"])
def test_a_robot_of_any_prefix_has_a_folder_below_the_directory(tmp_path: Path, robot: str) -> None:
    folder = robot_folder(tmp_path, robot, "20261127T050905Z")
    assert folder.resolve().parent.parent == (tmp_path / ROBOTS).resolve()
    folder.mkdir(parents=True)
    (folder / "manifest.json").touch()
    assert list(mirrored(tmp_path)) == [(robot, "20261127T050905Z", folder)]


@pytest.mark.parametrize("prefix", ["", "robot1", "hall/robot1"])
def test_a_key_tells_whose_map_it_is(prefix: str) -> None:
    key = keyframes_key(ZenohConfig(prefix=prefix))
    assert robot_and_run(f"{key}/run/manifest.json") == (prefix, "run")
