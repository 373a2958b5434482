"""Where things are: the project, its deploy folder, and the real recordings in a folder next to it."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / "deploy"
SHARED = ROOT.parent / "shared"
REAL_DATA = SHARED / "data"
