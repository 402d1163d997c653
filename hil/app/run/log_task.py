"""The controller's task that the record beside a log describes."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Final

from controller.excursion import Experiment
from hil.app.scenario.bus_scenario import parse_sil_scenario
from hil.app.scenario.deployment import parse_deployment
from hil.app.scenario.model_offer import Offered, offer_of
from hil.app.sil.testbed import believed_on_bus, task_on_bus
from hil.nodes.controller.node import Task
from models.effects import CATALOGUE, Catalogue
from models.files.tables import is_number, shown
from models.files.toml import parse_toml
from models.theta import Theta

Test = Callable[[object], bool]


def _values(raw: object) -> bool:
    return isinstance(raw, dict) and all(is_number(value) for value in raw.values())


def _numbers(raw: object) -> bool:
    return isinstance(raw, list) and all(is_number(value) for value in raw)


def _offer(raw: object) -> bool:
    return isinstance(raw, dict) and _values(raw.get("values")) and is_number(raw.get("at_s"))


def _experiment(raw: object) -> bool:
    return (
        isinstance(raw, dict)
        and _numbers(raw.get("times_s"))
        and _numbers(raw.get("places_m"))
        and is_number(raw.get("at_s"))
    )


_KEYS: Final[Mapping[str, tuple[Test, str]]] = {
    "controller": (lambda raw: isinstance(raw, str), "text"),
    "values": (_values, "an object of finite numbers"),
    "deployment": (lambda raw: isinstance(raw, str), "the text of a rig file"),
    "scenario": (lambda raw: isinstance(raw, str), "the text of a scenario file"),
    "dry_run": (lambda raw: isinstance(raw, bool), "true or false"),
    "entries": (
        lambda raw: isinstance(raw, int) and not isinstance(raw, bool) and 0 <= raw < 1 << 63,
        "a number of frames",
    ),
    "offered": (lambda raw: raw is None or _offer(raw), "an object of values and at_s"),
    "learned": (lambda raw: isinstance(raw, list) and all(map(_offer, raw)), "a list of objects of values and at_s"),
    "experiments": (
        lambda raw: isinstance(raw, list) and all(map(_experiment, raw)),
        "a list of objects of times_s, places_m and at_s",
    ),
}


def checked(record: Mapping[str, Any]) -> None:
    """Raises ValueError for a key of a log's record that holds what no run writes there."""
    for key, (good, wanted) in _KEYS.items():
        if key in record and not good(record[key]):
            raise ValueError(f"{key} must be {wanted}; got {shown(record[key])}")


def task_of(record: Mapping[str, Any], where: str, known: Catalogue = CATALOGUE) -> Task:
    """The controller's task that a log's record describes, whose rig may have the `known` effects. Raises ValueError
    where it does not.
    """
    checked(record)
    if not {"controller", "values"} <= set(record) or not {"deployment", "scenario"} & set(record):
        raise ValueError(
            f"{where}: record must have controller, values and a deployment or a scenario; got {', '.join(record)}"
        )
    values, name = Theta.read(record["values"]), record["controller"]
    try:
        offered = None if record.get("offered") is None else Offered.of(record["offered"])
        learned = [Offered.of(one) for one in record.get("learned", [])]
        experiments = tuple(Experiment.of(one) for one in record.get("experiments", []))
        if "deployment" in record:
            deployment = parse_deployment(record["deployment"], values)
            deployment = replace(deployment, rig=known.given_to(deployment.rig), offered=offered)
            offers = (offer_of(one, deployment.believed) for one in learned)
            task = replace(deployment.task(), controller=name, deadline_s=math.inf)
            return replace(task, learned=tuple(one for one in offers if one), experiments=experiments)
        on_bus = parse_sil_scenario(parse_toml(record["scenario"], "scenario"))
        loop = replace(on_bus.loop, belief=known.given_to(on_bus.loop.belief))
        on_bus = replace(on_bus, loop=loop)
    except ValueError as error:
        raise ValueError(f"{where}: record must describe a task; got: {error}") from None

    believed = partial(believed_on_bus, on_bus)
    first, *rest = (offer_of(one, believed) for one in (offered, *learned))
    more = {"offer": first, "learned": tuple(one for one in rest if one), "experiments": experiments}
    return task_on_bus(on_bus, believed(values), name, **more)
