"""Other processes for long work: so many here, or a Dask cluster (an optional extra) with the same program."""

import asyncio
import hashlib
import logging
import pickle
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import controller.registry
import models.effects.own
from hil.own_process import version_of
from models.files.python_file import installed
from models.workers import Mapper, cores, working

_PACKAGES: Final = ("numpy", "scipy", "casadi", "daqp", "numba")
_ROOT: Final = Path(__file__).parents[2]
_FOLDERS: Final = ("controller", "models", "plant", "hil")


@cache
def program_version() -> str:
    """Versions and hashes of program, packages, effects and controllers: those of one version give the same rows."""
    sources = hashlib.sha256()
    for path in sorted(p for folder in _FOLDERS for kind in ("*.py", "*.toml") for p in (_ROOT / folder).rglob(kind)):
        sources.update(path.relative_to(_ROOT).as_posix().encode() + path.read_bytes())
    packages = " ".join(f"{name} {version_of(name)}" for name in _PACKAGES)
    others = [
        f"{where} {digest[:12]}"
        for group, what in ((controller.registry.GROUP, "controllers"), (models.effects.own.GROUP, "effects"))
        for where, _, digest in installed(group, what)
    ]
    return ", ".join([f"{version_of()} sources {sources.hexdigest()[:12]}", packages, *others])


ANSWER_S: Final = 5.0  # in which a scheduler must answer
_SILENT_S: Final = 60.0  # in which a worker must say its version
OWN: Final = "capsule_own_"  # modules of a user's files, which a worker gets with the work


@dataclass(frozen=True)
class Workers:
    """The workers: so many processes (None: one a core), or the cluster of a scheduler. Raises ValueError."""

    processes: int | None = None
    scheduler: str | None = None

    def __post_init__(self) -> None:
        if self.processes is not None and not 1 <= self.processes <= 1024:
            raise ValueError(f"--workers must lie in [1, 1024]; got {self.processes}")
        if self.processes is not None and self.scheduler is not None:
            raise ValueError(
                f"--workers must be left out with --scheduler, whose cluster has its own; got {self.processes}"
            )

    @property
    def count(self) -> int:
        """How many work at once; 0 where only the scheduler knows."""
        return 0 if self.scheduler is not None else self.processes or cores()


@contextmanager
def spread(workers: Workers) -> Iterator[None]:
    """Within it independent fits of an identification are spread over the `workers`."""
    if workers.scheduler is None:
        with working(workers.count):
            yield
        return
    with connected(workers.scheduler) as client:
        same_program(client)
        with working(max(count_of(client), 1), _mapper(client)):
            yield


def _mapper(client: Any) -> Mapper:
    import cloudpickle

    def mapped(function: Callable[[Any], Any], items: Sequence[Any]) -> list[Any]:
        for name, module in list(sys.modules.items()):
            if name.startswith(OWN):
                cloudpickle.register_pickle_by_value(module)
        work = client.scatter(cloudpickle.dumps((function, list(items))), hash=False)
        return list(client.gather([client.submit(one, work, k, pure=False) for k in range(len(items))]))

    def one(data: bytes, number: int) -> Any:  # sent by value: the scheduler need not have this program
        function, items = pickle.loads(data)
        return function(items[number])

    return mapped


def packed(function: Callable[..., Any], *inputs: Any) -> Callable[[], Any]:
    """A call as a function that is sent by value, so that the scheduler need not have this program."""
    data = pickle.dumps((function, inputs))

    def work() -> Any:
        opened, given = pickle.loads(data)
        return opened(*given)

    return work


def same_program(client: Any) -> bool:
    """Whether all workers answer in time. Raises ValueError where one has another version of this program, or none."""
    own = program_version()
    try:
        # one that is silent is not waited for: its rows say their version
        found = client.sync(client._run, packed(program_version), on_error="return", callback_timeout=_SILENT_S)
    except OSError:
        return False
    for worker, got in found.items():
        if got != own:
            other = got if isinstance(got, str) else f"{type(got).__name__}: {got}"
            raise ValueError(f"--scheduler must have workers with this program, {own}; {worker} answers {other}")
    return True


def connected(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise ValueError(
            "--scheduler must stand where Dask is installed; it is not: install the extra 'dask'"
        ) from None
    try:
        kind = asyncio.run(asyncio.wait_for(_kind(address), ANSWER_S))
    # A wrong address, or another program there, raises many kinds of errors.
    except Exception as error:  # noqa: BLE001
        kind = str(error) or f"no answer in {ANSWER_S:g} s"
    if kind != "Scheduler":
        raise ValueError(
            f"--scheduler must be the address of a Dask scheduler, as tcp://HOST:8786; got {address}: {kind}"
        )
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    return Client(address, timeout=ANSWER_S)


async def _kind(address: str) -> str:
    """What answers there. `Client` would wait for ever where nothing does."""
    from distributed import Security, rpc

    async with rpc(address, timeout=ANSWER_S, connection_args=Security().get_connection_args("client")) as peer:
        return str((await peer.identity()).get("type", "no Dask"))


def count_of(client: Any) -> int:
    """How many workers there are; 0 where the scheduler does not answer."""
    try:
        return len(client.sync(client.scheduler.ncores, callback_timeout=ANSWER_S))
    except (OSError, TimeoutError):
        return 0
