"""Where things are: the project, what it deploys, and the real recordings beside it."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DEPLOY = ROOT / "deploy"
SHARED = ROOT.parent / "shared"
REAL_DATA = SHARED / "data"
