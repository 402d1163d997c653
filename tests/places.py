"""Where things lie in a checkout; tests of every folder read them from here."""

import os
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[1]
SCENARIOS: Final = ROOT / "hil" / "scenarios"
SHARED: Final = Path(os.environ.get("CAPSULE_SHARED", ROOT.parent / "shared"))
CAPSUBOT_MODEL: Final = ROOT / "tests" / "controller" / "vibro" / "capsubot_model.toml"
