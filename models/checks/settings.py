"""Settings of the checks of records; `tests/bench/bench_checks.py` holds their false alarms and power."""

from models.parameter import settings

SET = settings(__file__)
