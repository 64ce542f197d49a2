"""Where the repository lies, and the measured data beside it that not every machine has."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared"
SHIPPED = ROOT / "scenarios" / "shipped"
