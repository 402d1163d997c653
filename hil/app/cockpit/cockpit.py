"""`capsule cockpit`: a bus or a log on a page in the browser."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Final

import can

from hil.app.cockpit.operator_panel import OperatorPanel
from hil.app.cockpit.panels import Facts, frame_map_in, models_of
from hil.app.cockpit.phrases import TEXT
from hil.app.cockpit.source import BusSource, LogSource
from hil.app.console import answer, note, output_to_notes
from hil.app.run.clock import Clock, ClockedBus
from hil.app.run.log_task import task_of
from hil.app.run.loop import StopSignals
from hil.app.run.machine import open_bus
from hil.app.scenario.bus_scenario import load_sil_scenario, watched_bus
from hil.app.scenario.deployment import load_deployment
from hil.app.shared_options import Json, argument, option
from hil.bus.catalogue import FrameCatalogue, load_catalogue
from hil.drives.makers import MAKERS
from hil.drives.table import ActuatorTable
from hil.formats.reading import LOGS, is_log
from hil.log.place import record_path
from hil.log.reader import read_frames, read_log_record
from hil.nodes.frame_map import frame_map_of
from models.files.toml import in_file

OLDEST_S: Final = 5.0
"""Oldest driver stamp that counts, so that frames read late after a pause are not refused by their counters."""
EXTRA: Final = "cockpit"


def cockpit(
    path: Annotated[Path, argument("DEPLOYMENT.toml|LOG|SCENARIO.toml")],
    host: Annotated[str, option("--host", "ADDRESS")] = "127.0.0.1",
    port: Annotated[int, option("--port", "N")] = 8420,
    watch: Annotated[str | None, option("--watch", "CHANNEL")] = None,
    json_output: Json = False,
) -> None:
    """Serve a page until Ctrl-C. Raises ValueError of one sentence."""
    if find_spec("tornado") is None:
        raise ValueError(f"cockpit needs the package tornado, which is not installed: pip install '.[{EXTRA}]'")
    if not 0 <= port <= 65535:
        raise ValueError(f"--port must lie in [0, 65535]; got {port}")
    from hil.app.cockpit.server import Cockpit, bind, serve

    listener = bind(host, port)
    with listener, _source(path, watch) as (source, operator), StopSignals().caught() as signals:
        page = Cockpit(source, operator=operator)
        shown = f"[{host}]" if ":" in host else host
        address = f"http://{shown}:{listener.getsockname()[1]}/"
        with_token = f"{address}#token={page.token}" if operator else address
        watching = [TEXT("page.watch", address=address)] * (with_token != address)
        document = {"address": with_token, "watch_only": address}
        answer(json_output, document, f"cockpit: {with_token}", *watching, TEXT("page.end"))
        sys.stdout.flush()
        os.nice(5)
        serve(page, listener, host, lambda: bool(signals.wanted))


@contextmanager
def _source(path: Path, watch: str | None = None) -> Iterator[tuple[BusSource | LogSource, OperatorPanel | None]]:
    """The bus and its operator panel, or a log; of a simulated run on the local bus `watch` the frames alone."""
    if watch is not None:
        scenario, _ = load_sil_scenario(path)
        loop = scenario.loop
        about = f"{loop.kind} rig, simulated, {loop.control.controller}, local bus {watch}"
        facts = Facts(loop.name, about, frame_map_of(loop.kind), load_catalogue())
        with _heard_on(watched_bus(watch), facts, scenario.drive, loop.control.tick_s) as source:
            yield source, None
        return
    if path.suffix.lower() in LOGS and is_log(path):
        yield _log(path, load_catalogue()), None
        return
    if path.suffix.lower() != ".toml":
        raise ValueError(f"{path} must be a deployment file (.toml) or a CAN log ({', '.join(LOGS)})")
    deployment = load_deployment(path)
    kind, control, table, limits = deployment.rig.kind, deployment.control, deployment.bus, deployment.operator
    about = f"{kind} rig, {control.controller}, {table.interface} {table.channel}"
    with output_to_notes():
        models = models_of(deployment.task())
    facts = Facts(deployment.name, about, frame_map_of(kind), load_catalogue(), models)
    with in_file(path):
        bus = open_bus(table, path.parent)
    with _heard_on(bus, facts, deployment.drive, control.tick_s) as source:
        operator = OperatorPanel(source, path, limits if limits.accept else None)
        try:
            yield source, operator
        finally:
            operator.close()


@contextmanager
def _heard_on(inner: can.BusABC, facts: Facts, drive: ActuatorTable | None, tick_s: float) -> Iterator[BusSource]:
    clock = Clock()
    bus: can.BusABC = ClockedBus(inner, clock, OLDEST_S)
    if drive is not None:
        bus = MAKERS[drive.where].bus(bus, drive, tick_s)
    try:
        yield BusSource(bus, clock, facts)
    finally:
        bus.shutdown()


def _log(path: Path, catalogue: FrameCatalogue) -> LogSource:
    frames, ended = list(read_frames(path, lambda words: note(f"{path}: {words}"))), ""
    if record_path(path).exists():
        record = read_log_record(path)
        with output_to_notes():
            task = task_of(record, str(path))
        frame_map, models = frame_map_of(task.model.drive.name), models_of(task)
        about = f"{task.model.drive.name} rig, {task.controller}"
        ended = ": ".join(str(record[name]) for name in ("ended", "remedy") if record.get(name))
    else:
        names = {catalogue.by_id()[frame.id].name for frame in frames if frame.id in catalogue.by_id()}
        frame_map, models, about = frame_map_in(names), (), TEXT("page.no_record")
    source = LogSource(frames, Facts(path.name, about, frame_map, catalogue, models), ended)
    if not source.watch.last:
        raise ValueError(f"{path}: log must hold good frames of {Path(catalogue.source).name}; got none")
    return source
