"""What a report says of a capsule's time series: equations, sentences, the experiment that separates effects."""

from collections.abc import Mapping, Sequence
from typing import Final

from models.drives.drive import Drive
from models.effects import effect_words
from models.effects.equation import lines_of
from models.effects.refinements import LevelAtOnset
from models.formula import Line
from models.identification.finding import Alike
from models.identification.kinds.series.series import SeriesKind
from models.records.record import Record
from models.theta import Theta
from models.words.sentences import Quantity, Sentences

TEXT: Final = Sentences(__file__)
_MEMORY_S: Final = {"series_step": 0.03, "series_observed": 0.5, "series_free": None}
"""Time constant of the observer by the sentence on the error under it; None runs free."""
_SPARED: Final = (LevelAtOnset.id, "spared")


def equations(kind: SeriesKind, theta: Theta) -> list[Line]:
    """The model: how the surface holds the capsule, how the drive pushes it, and what each effect adds."""
    p = {**kind.nominal().base, **theta.base}
    lines = [*kind.surface.equations(p), *kind.drive.equations(p)]
    effects = [kind.catalogue[name] for name in sorted(theta.effects)]
    return [*lines, *lines_of(effects, theta, turns=kind.unit == "rad")]


def statements(kind: SeriesKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """On sensor and drive, and the error over short, middle and unlimited foresight; not over a short one where a
    position is measured: an observer that follows its noise loses step.
    """
    said = about_the_rig(kind.drive, kind.noise_std, kind.unit, theta_by_stage["augmented"])
    for key, memory in _MEMORY_S.items():
        if kind.drive.imposed or key != "series_step":
            rms = zip(theta_by_stage, kind.foresight_rms(records, [*theta_by_stage.values()], memory), strict=True)
            errors = [TEXT("series_error", error=Quantity(e, kind.unit), stage=stage) for stage, e in rms]
            said.append(TEXT(key, errors=errors))
    return said


def about_the_rig(drive: Drive, noise_std: float, unit: str, theta: Theta) -> list[str]:
    """On the sensor, and on what records under this drive leave open."""
    said = [TEXT("series_noise", noise=Quantity(noise_std, unit))]
    if _SPARED in theta:
        nose, pressed = (min(max(1 + side * theta[_SPARED], 0.0), 1.0) for side in (1, -1))
        said.append(TEXT("series_spared", nose=nose, pressed=pressed))
    return said + drive.unidentifiable()


def next_experiment(kind: SeriesKind, theta: Theta, records: Sequence[Record], alike: Alike) -> str | None:
    """What would separate each effect from those that are alike."""
    wishes = []
    for name in sorted(name for name in theta.effects if alike.get(name)):
        one, *others = (effect_words(each, kind.catalogue) for each in (name, *alike[name]))
        wishes.append(TEXT("series_separate", effect=one, others=others, how=kind.catalogue[name].separated_by))
    return " ".join(wishes) or None
