"""The maps of robots in folders become the common map, in the frame of the first that came; what is damaged is told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from building_maps.halls import around, hall, map_of

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.merging.merging import merge
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.manifest import MapName
from wayfi.recordings.map.saving import save_map
from wayfi.service.config import Config
from wayfi.service.fleet.fleet_file import FLEET, Member, read_fleet
from wayfi.service.fleet.merging_process import join_maps
from wayfi.service.fleet.robot_folders import MAP, robot_folder

CONFIG = Config()
WAYS = {"a": around(0.0, 96.0), "b": around(60.0, 80.0, back=True, inset_m=5.0), "c": around(20.0, 90.0, inset_m=3.0)}


@pytest.fixture(scope="module")
def parts() -> dict[str, BuildingMap]:
    return {name: map_of(hall(), way, seed=seed) for seed, (name, way) in enumerate(WAYS.items())}


def bring(directory: Path, robot: str, building: BuildingMap, former: MapName | None = None) -> Path:
    """A robot's map, as it was fetched."""
    folder = robot_folder(directory, robot, "run")
    save_map(folder, building, former=former)
    return folder


def off_m(member: Member, way: str, frame: str) -> float:
    """By how much the frame of a drive's map is off, where the common one begins with the drive `frame`."""
    assert member.T_common_map is not None
    true = Pose2.of(WAYS[frame][0]).between(Pose2.of(WAYS[way][0]))
    return float(np.hypot(true.x - member.T_common_map[0], true.y - member.T_common_map[1]))


def test_the_frame_stays_that_of_the_first_though_an_earlier_name_comes_later(
    parts: dict[str, BuildingMap], tmp_path: Path
) -> None:
    bring(tmp_path, "robot2", parts["b"])
    join_maps(tmp_path, CONFIG)
    bring(tmp_path, "robot1", parts["a"])
    fleet = join_maps(tmp_path, CONFIG)
    assert fleet == read_fleet(tmp_path / MAP)
    assert [member.robot for member in fleet.members] == ["robot2", "robot1"]
    assert off_m(fleet.members[0], "b", "b") < 0.1
    assert off_m(fleet.members[1], "a", "b") < 0.1
    assert load_map(tmp_path / MAP).map_version == 2


def test_the_common_map_is_another_than_that_of_its_only_robot(parts: dict[str, BuildingMap], tmp_path: Path) -> None:
    """That robot goes on with a map of several days, which is the common one as long as it is alone."""
    own = bring(tmp_path, "robot1", merge(parts["a"], parts["b"], CONFIG).building)
    for _ in range(2):
        join_maps(tmp_path, CONFIG)
        common = load_map(tmp_path / MAP)
        assert common.map_id != load_map(own).map_id
        assert {keyframe.session for keyframe in common.building.keyframes} == {0, 1}
    assert common.map_version == 2


def test_of_two_robots_that_go_on_with_one_map_that_is_joined_once(
    parts: dict[str, BuildingMap], tmp_path: Path
) -> None:
    known = MapName("f" * 32, 1)
    for robot, own in (("robot1", "b"), ("robot2", "c")):
        bring(tmp_path, robot, merge(parts["a"], parts[own], CONFIG).building, known)
    fleet = join_maps(tmp_path, CONFIG)
    assert all(off_m(member, "a", "a") < 0.1 for member in fleet.members)
    sessions = {keyframe.session for keyframe in load_map(tmp_path / MAP).building.keyframes}
    assert sessions <= {0, 1, 2}


def test_a_map_that_contradicts_itself_is_told_and_the_others_are_joined(
    parts: dict[str, BuildingMap], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bring(tmp_path, "robot1", replace(parts["a"], poses=np.full_like(parts["a"].poses, np.nan)))
    bring(tmp_path, "robot2", parts["b"])
    (tmp_path / MAP).mkdir()
    (tmp_path / MAP / FLEET).write_text("")
    assert [member.robot for member in join_maps(tmp_path, CONFIG).members] == ["robot2"]
    told = capsys.readouterr().err.splitlines()
    assert any("robot1/run: contradicts itself" in line for line in told)
    assert any("fleet.json: does not say how a common map is made" in line for line in told)
