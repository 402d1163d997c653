"""What a command line asks of a closed-loop run, in the loop alone (`track`) or over the bus (`sil`)."""

from dataclasses import dataclass, replace
from pathlib import Path

from controller.drives import DRIVES
from hil.app.console import note
from hil.app.scenario.scenario import TrackScenario
from models.effects import CATALOGUE, Catalogue
from models.files.tables import check_word
from models.identification.finding import STAGES
from models.identification.model import read_model
from models.theta import Theta


@dataclass(frozen=True)
class Options:
    """`controller` and `seed` are the scenario's where None. `model` is a file that close-loop wrote, of which `stage`
    is used; without it the controller knows nominal values. `reference` is a file whose table [reference] takes the
    scenario's place (`with_reference`). `out` is a folder for what is written. `learn`: identify in the background once
    the model broke. `mcap` is a file for the frames beside the log in `out`, `watch` a local bus on which they
    are shown. `catalogue` are the effects that the believed rig may have.
    """

    controller: str | None = None
    model: Path | None = None
    stage: str | None = None
    seed: int | None = None
    out: Path | None = None
    json_output: bool = False
    reference: Path | None = None
    learn: bool = False
    mcap: Path | None = None
    watch: str | None = None
    catalogue: Catalogue = CATALOGUE

    def of(self, scenario: TrackScenario) -> tuple[str, int]:
        """The controller's name and the seed for `scenario`."""
        name = scenario.control.controller if self.controller is None else self.controller
        return name, scenario.seed if self.seed is None else self.seed

    def equipped(self, scenario: TrackScenario) -> TrackScenario:
        """`scenario` with the effects of the catalogue in what is believed."""
        return replace(scenario, belief=self.catalogue.given_to(scenario.belief))

    def values(self, kind: str) -> tuple[Theta, str]:
        """Parameters that a rig of `kind` is believed to have, and the name of their stage. Raises ValueError."""
        if self.stage is not None:
            check_word(self.stage, "--stage", STAGES)
        if self.model is None:
            if self.stage not in (None, "nominal"):
                raise ValueError(f"--stage must stand with --model unless it is nominal; got {self.stage!r} alone")
            return Theta(), "nominal"
        stage = self.stage or "augmented"
        model = read_model(self.model, *(DRIVES[kind].models or (kind,)), catalogue=self.catalogue)
        if stage in model.cautions:
            note(f"{self.model}: {model.cautions[stage]}")
        return model.believed(stage), stage
