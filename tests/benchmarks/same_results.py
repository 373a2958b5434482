"""Do two commits give the same bytes? Replays recordings at both and compares what they leave.

    python tests/benchmarks/same_results.py BEFORE [AFTER] [--data DIR] [--only NAME ...]

Each commit is checked out and installed by its own Makefile, in a folder that is deleted afterwards. AFTER is HEAD
unless it is given. Exit 0 where every file is the same, 1 where one differs.
"""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
REAL = ROOT.parent / "shared" / "data"
RECORDINGS = ("b14test1", "b24test2", "b3test2", "flat_calib3", "intel", "intel_wifi")
COMPARED = ("trajectory.tum", "online.tum", "closures.csv")


@contextmanager
def installed(commit: str, folder: Path) -> Iterator[Path]:
    """The `wayfi` program of a commit, installed below `folder`."""
    tree = folder / "tree"
    subprocess.run(["git", "worktree", "add", "--quiet", "--detach", tree, commit], cwd=ROOT, check=True)
    try:
        subprocess.run(["make", "--silent", ".venv/installed"], cwd=tree, check=True)
        yield tree / ".venv" / "bin" / "wayfi"
    finally:
        subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=ROOT, check=True)


def replay_all(program: Path, recordings: Sequence[Path], folder: Path) -> None:
    """Replay each recording into a folder of its name."""
    for recording in recordings:
        command = [program, "replay", recording, "--out", folder / recording.name, "--no-rrd", "--quiet"]
        subprocess.run(command, check=True)


def differences(before: Path, after: Path) -> list[str]:
    """The compared files of two replays that are not the same bytes."""
    return [name for name in COMPARED if (before / name).read_bytes() != (after / name).read_bytes()]


def main() -> int:
    """Compare two commits."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("after", nargs="?", default="HEAD")
    parser.add_argument("--data", type=Path, default=REAL, help="the folder of the recordings")
    parser.add_argument("--only", nargs="+", default=RECORDINGS, help="names of recordings in it")
    options = parser.parse_args()
    recordings = [options.data / name for name in options.only]
    same = True
    with tempfile.TemporaryDirectory() as folder:
        sides = Path(folder) / "before", Path(folder) / "after"
        for commit, side in zip((options.before, options.after), sides, strict=True):
            with installed(commit, side) as program:
                replay_all(program, recordings, side)
        for recording in recordings:
            differing = differences(*(side / recording.name for side in sides))
            same = same and not differing
            said = f"{', '.join(differing)} differ" if differing else "the same bytes"
            sys.stdout.write(f"{recording.name}: {said}\n")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
