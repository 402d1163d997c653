"""A change of F_e that the slip limit does not feel, or the other way round: who is named for it."""

from dataclasses import replace
from pathlib import Path

import pytest

from models.drives.pull import Pull
from models.effects import CATALOGUE
from models.formula import line_text
from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for
from models.identification.kinds.reports.series import about_the_rig, equations
from models.identification.kinds.series.series import SeriesKind
from models.identification.search.candidates import compare_candidates
from models.identification.search.fitted_model import FittedModel, ahead
from models.identification.search.screening import screen
from models.identification.settings import SET
from models.records.record import read_record
from models.rigs.reader import read_rig
from models.surfaces.surface import Plate
from models.theta import Theta
from tests.plant.series import answer_of, make_series

RIVALS = {
    "slip_folds": ("fold_periodic", "stenosis", "lumen_taper"),
    "nose_asymmetry": ("directional_asymmetry", "incline_gravity", "sensor_bias"),
    "film_weakening": ("stribeck", "viscous_drag", "stress_relaxation"),
}


SPARED = {"nose_asymmetry": 1.0, "film_weakening": 1.0, "slip_folds": -1.0}


@pytest.mark.parametrize("name", sorted(RIVALS))
def test_what_changes_one_side_alone_is_called_by_its_name(name: str, tmp_path: Path) -> None:
    """A law that changed both would leave more than its confounded effects do, and they would be named."""
    folder = make_series("pull", name, 5, tmp_path, 15.0)
    rig = read_rig(folder / "rig.toml")
    records = [read_record(folder / f"train_{k}.csv.gz", rig) for k in (1, 2)]
    full = kind_for(rig, records)
    assert isinstance(full, SeriesKind)
    kind = replace(full, effects=tuple(CATALOGUE[effect] for effect in RIVALS[name]))
    splits = [(records[:1], records[1:])]
    base = Fitter.of(kind, records[:1], []).far([kind.nominal()]).theta
    model, screened = FittedModel(kind, splits).fitted([base]), screen(kind, records[:1], [], base)
    trials = compare_candidates(model, screened, lambda name, share: None)
    assert trials[0].effect == answer_of(name)
    assert all(ahead(trials[0].blocks, trial.blocks) > SET.apart for trial in trials[1:])
    assert trials[0].finer
    assert trials[0].finer.effects == (trials[0].effect, "level_at_onset")
    assert trials[0].finer.thetas[0]["level_at_onset", "spared"] == pytest.approx(SPARED[name], abs=0.15)


def test_a_report_says_which_side_feels_it_in_whole_sentences() -> None:
    theta = Theta.of({("level_at_onset", "spared"): -0.97, ("level_at_onset", "kept"): 0.2})
    said = " ".join(about_the_rig(Pull(), 1e-3, "N", theta))
    assert (
        "The nose feels 3 % of the changed resistance (F_e), the slip limit under the wall's pressure 100 % (f_c)"
        in said
    )
    kind = SeriesKind.build(Plate(0.1), Pull(), 1e-3)
    law = line_text(equations(kind, Theta.of({"friction_coefficient": 0.3, **theta}))[-1])
    assert "scale at the nose = lambda - 0.97 (lambda - 1); " in law
    assert "scale of the weight = lambda - 0.2 (lambda - 1); " in law
