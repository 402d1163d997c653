"""Every benchmark can be started: what it imports is there."""

import importlib
from pathlib import Path

import pytest


@pytest.mark.parametrize("name", sorted(path.stem for path in (Path(__file__).parent / "bench").glob("bench_*.py")))
def test_a_benchmark_can_be_started(name: str) -> None:
    assert importlib.import_module(f"tests.bench.{name}").__doc__
