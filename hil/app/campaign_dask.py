"""The same runs on a Dask cluster: an optional extra."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

from hil.app.campaign_file import Job
from hil.app.campaign_work import Row, run_jobs

CONNECT_S: Final = "10s"
RETRIES: Final = 3
AHEAD: Final = 4


def scheduled(parts: Sequence[Sequence[Job]], address: str) -> Iterator[list[Row]]:
    """The rows of each chunk as it ends, computed by the workers of the scheduler at `address`; a chunk whose worker dies goes to
    another one. Workers need this program installed. Raises ValueError where Dask or the scheduler is not there."""
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise ValueError("--scheduler must stand where Dask is installed; it is not: install the extra 'dask'") from None
    try:
        client: Any = Client(address, timeout=CONNECT_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise ValueError(f"--scheduler must be the address of a Dask scheduler; got {address}: {type(error).__name__}") from None
    with client:
        waiting = list(reversed(parts))

        def send() -> Any:
            return client.submit(run_jobs, tuple(waiting.pop()), retries=RETRIES, pure=False)

        ahead = AHEAD * max(len(client.scheduler_info()["workers"]), 1)
        ended = as_completed([send() for _ in range(min(ahead, len(waiting)))])
        for future in ended:
            yield future.result()
            if waiting:
                ended.add(send())
