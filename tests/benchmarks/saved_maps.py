"""What a saved map costs: bytes a keyframe, seconds to save, to save what is new and to load; 50 kills while saving.

    python tests/benchmarks/saved_maps.py MAP...

Each MAP is the folder of a saved map, or of results; it is laid side by side with itself up to 1,000 and 10,000
keyframes. Seconds are of one core; the wall's are longer where other work shares the machine.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from results_file import say

from wayfi.backend.grid.map_config import MapConfig
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.optimising import drawn
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.saving import MapSaver

SIZES = (1_000, 10_000)
KILLS = 50
NEW = 100  # keyframes between two saves
LOADING = (
    "import sys, time, pathlib; from wayfi.recordings.map.loading import load_map; "
    "kb = lambda: int(pathlib.Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0]); "
    "before, begun, cpu = kb(), time.perf_counter(), time.process_time(); kept = load_map(pathlib.Path(sys.argv[1])); "
    "print(time.perf_counter() - begun, time.process_time() - cpu, (kb() - before) / 1024)"
)
SAVING = (
    "import sys, pathlib; from wayfi.recordings.map.loading import load_map; "
    "from wayfi.recordings.map.saving import save_map; here, other = map(pathlib.Path, sys.argv[1:]); "
    "building, name = load_map(other).building, load_map(here).name; print('ready', flush=True); "
    "print(save_map(here, building, former=name), flush=True)"
)


def enlarged(building: BuildingMap, keyframes: int) -> BuildingMap:
    """The map beside itself, again and again, cut to so many keyframes; its graph is left out where it was cut."""
    count, span_m = len(building.keyframes), float(np.ptp(building.poses[:, 0])) + 30.0
    times, most = -(-keyframes // count), max(building.factors, default=-1) + 1
    poses = np.concatenate([building.poses + np.array([n * span_m, 0.0, 0.0]) for n in range(times)])[:keyframes]
    kept = [replace(k, hits=k.hits.copy()) for _ in range(times) for k in building.keyframes][:keyframes]
    factors = {
        number + n * most: replace(f, **{end: getattr(f, end) + n * count for end in ("a", "b") if end in f.__slots__})
        for n in range(times)
        for number, f in building.factors.items()
    }
    heard = [replace(f, keyframe=f.keyframe + n * count) for n in range(times) for f in building.fingerprints]
    return replace(
        building,
        keyframes=kept,
        poses=poses,
        calibrations=np.tile(building.calibrations, (times, 1))[:keyframes],
        factors={number: f for number, f in factors.items() if max(f.a, f.b) < keyframes},
        closures=[],
        vetoed=frozenset(),
        pieces=(),
        fingerprints=[f for f in heard if f.keyframe < keyframes],
        grid=drawn(kept, poses, MapConfig()),
    )


def first(building: BuildingMap, keyframes: int) -> BuildingMap:
    """The first keyframes of a map, its grid and its radio as they are."""
    return replace(
        building,
        keyframes=building.keyframes[:keyframes],
        poses=building.poses[:keyframes],
        calibrations=building.calibrations[:keyframes],
        factors={number: f for number, f in building.factors.items() if max(f.a, f.b) < keyframes},
        fingerprints=[f for f in building.fingerprints if f.keyframe < keyframes],
    )


def measure(building: BuildingMap, folder: Path) -> str:
    """A row of the table: keyframes, MB, kB a keyframe, s to save it all, s for what is new, s to load it, MB."""
    saver, keyframes = MapSaver(folder), len(building.keyframes)
    whole_s = seconds(lambda: saver.save(first(building, keyframes - NEW)))
    new_s = seconds(lambda: saver.save(building))
    size = sum(path.stat().st_size for path in folder.iterdir())
    told = subprocess.run([sys.executable, "-c", LOADING, folder], capture_output=True, text=True, check=True).stdout
    wall_s, cpu_s, memory_mb = map(float, told.split())
    return (
        f"| {keyframes} | {size / 1e6:.1f} | {size / 1e3 / keyframes:.2f} | {whole_s:.2f} | {new_s:.2f} "
        f"| {cpu_s:.2f} ({wall_s:.2f}) | {memory_mb:.0f} |"
    )


def seconds(act: Callable[[], object]) -> float:
    """The seconds of this process that `act` takes."""
    begun = time.process_time()
    act()
    return time.process_time() - begun


def kills(folder: Path, other: Path) -> str:
    """Kill a process 50 times while it saves another map over one; says how often which was left whole."""
    left: list[str] = []
    keyframes, save_s = load_map(folder).manifest.counts["keyframes"], 0.0
    for k in range(KILLS):
        with subprocess.Popen([sys.executable, "-c", SAVING, folder, other], stdout=subprocess.PIPE, text=True) as one:
            assert one.stdout is not None
            one.stdout.readline()
            begun = time.monotonic()
            if k == 0:
                one.stdout.readline()
                save_s = time.monotonic() - begun
            else:
                time.sleep(save_s * 1.1 * k / KILLS)
            os.kill(one.pid, signal.SIGKILL)
        found = load_map(folder)
        left.append("damaged" if found.warnings else "whole")
    return f"{KILLS} kills in {save_s:.2f} s of saving over {keyframes} keyframes: {left.count('whole')} whole maps"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("maps", nargs="+", type=Path)
    for path in parser.parse_args().maps:
        building = load_map(path).building
        say(f"{path}\n| keyframes | MB | kB each | s to save | s of {NEW} new | s to load | MB of memory |")
        with tempfile.TemporaryDirectory() as place:
            folders = [Path(place) / str(size) for size in SIZES]
            for size, folder in zip(SIZES, folders, strict=True):
                say(measure(enlarged(building, size), folder))
            say(kills(folders[0], path))


if __name__ == "__main__":
    main()
