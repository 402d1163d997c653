"""What a report says of a capsule's time series: equations, sentences, the experiment that tells effects apart."""

from collections.abc import Mapping, Sequence

import numpy as np

from models.drives.drive import Drive
from models.effects.equation import lines_of
from models.effects.refinements import LevelAtOnset
from models.formula import Line
from models.identification.kinds.series.series import SeriesKind
from models.records.record import Record
from models.theta import Theta

_FORESIGHTS = (  # memory of the observer in s, and what it makes of an error
    (0.03, "one step ahead of an observer that forgets within 0.03 s"),
    (0.5, "ahead of an observer that forgets within half a second"),
    (None, "in a free run"),
)
_SPARED = (LevelAtOnset.id, "spared")


def equations(kind: SeriesKind, theta: Theta) -> list[Line]:
    """The model: how the surface holds the capsule, how the drive pushes it, and what each effect adds."""
    p = {**kind.nominal().base, **theta.base}
    lines = [*kind.surface.equations(p), *kind.drive.equations(p)]
    return [*lines, *lines_of([kind.catalogue[name] for name in sorted(theta.effects)], theta)]


def statements(kind: SeriesKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """Sentences for the report: about the sensor and the drive, and the error over short, middle and unlimited
    foresight. Short ones tell nothing of a measured place: an observer that follows its noise is thrown out of step.
    """
    said = about_the_rig(kind.drive, kind.noise_std, kind.unit, theta_by_stage["augmented"])
    for memory, words in _FORESIGHTS if kind.drive.imposed else _FORESIGHTS[1:]:
        rms = (
            f"{kind.foresight_rms(records, theta, memory):.3g} {kind.unit} {stage}"
            for stage, theta in theta_by_stage.items()
        )
        said.append(f"Rms on the training records, {words}: {', '.join(rms)}.")
    return said


def about_the_rig(drive: Drive, noise_std: float, unit: str, theta: Theta) -> list[str]:
    """Sentences on the sensor and on what records under this drive cannot identify."""
    said = [f"Noise of the sensor: {noise_std:.3g} {unit}."]
    if _SPARED in theta:
        nose, pressed = (f"{100 * min(max(1 + side * theta[_SPARED], 0.0), 1.0):.0f} %" for side in (1, -1))
        said.append(
            f"Of the changed resistance the nose feels {nose} (F_e), what the wall presses on the slip limit {pressed}"
            " (f_c)."
        )
    said += drive.unidentifiable()
    return said


def next_experiment(kind: SeriesKind, theta: Theta, records: Sequence[Record]) -> str | None:
    """What would separate each effect from those confounded with it, beside the records that there are."""
    told = [
        f"to tell {name} from {' and '.join(kind.catalogue[name].confounders)}: {kind.catalogue[name].separated_by}"
        for name in sorted(theta.effects)
    ]
    return "; ".join([*told, f"there are so far {_there(records)}"]) if told else None


def _there(records: Sequence[Record]) -> str:
    """What the records hold already, each by its name."""
    return ", ".join(f"{record.name} ({np.ptp(record['t_s']):.0f} s{_travels(record)})" for record in records)


def _travels(record: Record) -> str:
    """Between which places each position lies, to 0.1 % of the way between them."""
    told = []
    for name, x in record.columns.items():
        if name.endswith("position_m"):
            places = 2 - int(np.floor(np.log10(max(1e3 * np.ptp(x), 1e-9))))
            low, high = (round(1e3 * float(end), places) + 0.0 for end in (x.min(), x.max()))
            told.append(f", {name.removesuffix('_m').replace('_', ' ')} {low:g} to {high:g} mm")
    return "".join(told)
