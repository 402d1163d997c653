"""The task of the controller as the record beside a log describes it."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Final

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from controller.reference import Experiment
from controller.step.library import available
from hil.app.scenario.bus_scenario import parse_sil_scenario
from hil.app.scenario.deployment import parse_deployment
from hil.app.scenario.model_use import Offered, offer_of
from hil.app.sil.testbed import believed_on_bus, task_on_bus
from hil.nodes.task import Task
from models.effects import CATALOGUE, Catalogue
from models.files.toml import parse_toml, shown
from models.theta import Theta
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)


class _Stated(BaseModel):
    model_config = ConfigDict(strict=True, allow_inf_nan=False)


class _Offer(_Stated):
    values: dict[str, float]
    at_s: float


class _Experiment(_Stated):
    times_s: list[float]
    places_m: list[float]
    at_s: float


class _Record(_Stated):
    controller: str = Field("", description="text")
    values: dict[str, float] = Field({}, description="an object of finite numbers")
    deployment: str = Field("", description="the text of a rig file")
    scenario: str = Field("", description="the text of a scenario file")
    dry_run: bool = Field(False, description="true or false")
    in_c: bool = Field(False, description="true or false")
    entries: int = Field(0, ge=0, lt=1 << 63, description="a number of frames")
    offered: _Offer | None = Field(None, description="an object of values and at_s")
    others: dict[str, dict[str, float]] = Field({}, description="an object of objects of finite numbers")
    learned: list[_Offer] = Field([], description="a list of objects of values and at_s")
    experiments: list[_Experiment] = Field([], description="a list of objects of times_s, places_m and at_s")


def checked(record: Mapping[str, Any]) -> None:
    """Raises ValueError for a key of a log's record with a value that no run writes."""
    try:
        _Record.model_validate(dict(record))
    except ValidationError as error:
        key = str(error.errors()[0]["loc"][0])
        wanted = _Record.model_fields[key].description
        raise ValueError(f"{key} must be {wanted}; got {shown(record[key])}") from None


def task_of(record: Mapping[str, Any], where: str, known: Catalogue = CATALOGUE) -> Task:
    """The controller's task of a log's record, whose rig may have the `known` effects. Raises ValueError."""
    checked(record)
    if not {"controller", "values"} <= set(record) or not {"deployment", "scenario"} & set(record):
        raise ValueError(
            f"{where}: record must have controller, values and a deployment or a scenario; got {', '.join(record)}"
        )
    values, name, in_c = Theta.read(record["values"]), record["controller"], record.get("in_c", False)
    if in_c and not available():
        raise ValueError(TEXT("log_task.in_c", where=where))
    try:
        offered = None if record.get("offered") is None else Offered.of(record["offered"])
        others = {stage: Theta.read(one) for stage, one in record.get("others", {}).items()}
        learned = [Offered.of(one) for one in record.get("learned", [])]
        experiments = tuple(Experiment.of(one) for one in record.get("experiments", []))
        if "deployment" in record:
            deployment = parse_deployment(record["deployment"], values)
            deployment = replace(deployment, rig=known.given_to(deployment.rig), offered=offered, others=others)
            offers = (offer_of(one, deployment.believed) for one in learned)
            task = replace(deployment.task(), controller=name, deadline_s=math.inf, in_c=in_c)
            return replace(task, learned=tuple(one for one in offers if one), experiments=experiments)
        on_bus = parse_sil_scenario(parse_toml(record["scenario"], "scenario"))
        loop = replace(on_bus.loop, belief=known.given_to(on_bus.loop.belief))
        on_bus = replace(on_bus, loop=loop)
    except ValueError as error:
        raise ValueError(f"{where}: record must describe a task; got: {error}") from None

    believed = partial(believed_on_bus, on_bus)
    first, *rest = (offer_of(one, believed) for one in (offered, *learned))
    beside = {stage: believed(one) for stage, one in others.items()}
    more = {"offer": first, "learned": tuple(one for one in rest if one), "experiments": experiments, "in_c": in_c}
    return task_on_bus(on_bus, believed(values), name, others=beside, **more)
