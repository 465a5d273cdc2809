"""Where the repository is, and the measured logs that may be beside it."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared"
MEASURED = SHARED / "data" / "dbo_piezo"
