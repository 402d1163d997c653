"""Settings of the checks of records; `tests/bench/bench_checks.py` holds their false alarms and power."""

from typing import Final

from models.files.settings import Settings

SET: Final = Settings(__file__)
