"""A process that is killed while it saves leaves the former map or the new one, whole."""

import multiprocessing
import os
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from multiprocessing.connection import Connection
from pathlib import Path

import pytest
from building_maps.made_up import grown, made_up_map

from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.recordings.files.map_folder import MapError, locked
from wayfi.recordings.files.replaced_together import READY
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.saving import STAGED, MapSaver, save_map

KILLS = 50
SIZES = (60, 40)  # keyframes of every other version
MASK = b"P5 1 1 255 0"
FORK = multiprocessing.get_context("fork")


@pytest.fixture(scope="module")
def building() -> BuildingMap:
    return made_up_map(max(SIZES), beams=8)


@pytest.fixture
def folder(building: BuildingMap, tmp_path: Path) -> Path:
    """A map of the first of SIZES, with a mask of the user's beside it."""
    save_map(tmp_path / "map", building)
    (tmp_path / "map" / "keepout.pgm").write_bytes(MASK)
    return tmp_path / "map"


def save_on_and_on(folder: Path, building: BuildingMap, telling: Connection) -> None:
    """Save one version after another, and tell of each."""
    former = load_map(folder).name
    saver, version = MapSaver(folder, former=former), former.map_version
    while True:
        telling.send(version)
        version = saver.save(grown(building, SIZES[version % 2])).map_version


def killed_while_saving(folder: Path, building: BuildingMap, after_s: float) -> int:
    """Kill a process that saves one version after another; returns the last that it has told of."""
    told, telling = FORK.Pipe(duplex=False)
    process = FORK.Process(target=save_on_and_on, args=(folder, building, telling))
    process.start()
    telling.close()
    version: int = told.recv()
    time.sleep(after_s)
    os.kill(process.pid or 0, signal.SIGKILL)
    process.join()
    with suppress(EOFError):
        while True:
            version = told.recv()
    return version


def assert_whole(folder: Path) -> int:
    """The map and what lies beside it are whole; returns its version."""
    loaded = load_map(folder)
    assert loaded.warnings == ()
    assert len(loaded.building.keyframes) == SIZES[(loaded.map_version - 1) % 2]
    assert (folder / "keepout.pgm").read_bytes() == MASK
    return loaded.map_version


def test_fifty_kills_leave_the_former_map_or_the_new_one(folder: Path, building: BuildingMap) -> None:
    cut_off = 0
    for k in range(KILLS):
        told = killed_while_saving(folder, building, k * 0.002)
        cut_off += (folder / STAGED).exists() or (folder / READY).exists()
        assert told <= assert_whole(folder) <= told + 1
    assert cut_off > KILLS // 4


def save_now_and_then(folder: Path, building: BuildingMap) -> None:
    saver = MapSaver(folder, former=load_map(folder).name)
    for keyframes in 10 * SIZES:
        saver.save(grown(building, keyframes))
        time.sleep(0.05)


def test_a_map_that_is_loaded_while_it_is_saved_is_one_of_the_two(folder: Path, building: BuildingMap) -> None:
    process = FORK.Process(target=save_now_and_then, args=(folder, building))
    process.start()
    versions = []
    while process.is_alive():
        loaded = load_map(folder)
        assert loaded.warnings == ()
        assert len(loaded.building.keyframes) in SIZES
        versions.append(loaded.map_version)
    assert versions == sorted(versions)
    assert len(set(versions)) > 3


class Killed(BaseException):
    """A kill, at one of the steps of the file system."""


def save_up_to(step: int, folder: Path, building: BuildingMap, patched: pytest.MonkeyPatch) -> bool:
    """Save the next version, and die at a step of the file system; returns whether it was killed."""
    steps = 0

    def dying(act: Callable[..., object]) -> Callable[..., object]:
        def one(*arguments: object, **named: object) -> object:
            nonlocal steps
            steps += 1
            if steps > step:
                raise Killed
            return act(*arguments, **named)

        return one

    former = load_map(folder).name
    saver = MapSaver(folder, former=former)
    try:
        with patched.context() as during:
            for name in ("unlink", "replace", "rename", "rmdir", "write_bytes"):
                during.setattr(Path, name, dying(getattr(Path, name)))
            saver.save(grown(building, SIZES[former.map_version % 2]))
    except Killed:
        return True
    return False


def test_a_kill_at_any_step_leaves_the_former_map_or_the_new_one(
    folder: Path, building: BuildingMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    step, versions = 0, [1]
    while save_up_to(step, folder, building, monkeypatch):
        versions.append(assert_whole(folder))
        step += 1
    assert step > 20
    assert {later - before for before, later in pairwise(versions)} == {0, 1}


def test_one_process_saves_at_a_time(folder: Path, building: BuildingMap) -> None:
    with locked(folder), pytest.raises(MapError, match="another process is saving a map there"):
        save_map(folder, building)
    save_map(folder, building)


@pytest.mark.parametrize("place", ["/proc/nowhere/map", "/dev/null/map"])
def test_a_place_that_nothing_can_be_written_to_is_said(place: str, building: BuildingMap) -> None:
    with pytest.raises(MapError, match="cannot be written"):
        save_map(Path(place), building)
