"""Profile likelihoods: as high as real fits with a parameter held, and flat where records hold nothing."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from models.identification.finding import Profile
from models.identification.fitting.confidence import memory
from models.identification.fitting.fit import Fit
from models.identification.fitting.fitter import Fitter
from models.identification.fitting.profile import LINE, profiles
from models.identification.kinds import kind_for
from models.identification.kinds.reports import AnyKind
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.theta import Theta
from tests.rig_texts import GUT

RIG = parse_rig(tomllib.loads(f'{GUT}\n[rig]\nkind = "pull"\n[noise]\nforce_std_N = 1e-3\n'))


def fitted(*effects: str) -> tuple[AnyKind, list[Record], Fit]:
    t = np.arange(0, 8, 2e-3)
    x = 3e-3 * (1 - np.cos(2 * np.pi * t / 4))
    blank = Record("pull", "pull", {"t_s": t, "position_m": x, "force_N": np.zeros_like(t)})
    kind = kind_for(RIG, [blank])
    truth = kind.nominal() | Theta({"hoop_stress_factor": 1.05, "friction_coefficient": 0.08})
    record = kind.imitate(blank, truth, np.random.default_rng(0))
    kind, start = kind_for(RIG, [record]), truth
    for name in effects:
        start = start.with_(name, kind.declared(name).start() | {kind.declared(name).amplitude().name: 1e-4})
    return kind, [record], Fitter.of(kind, [record], effects, kind.final).near(start)


def test_a_profile_is_that_of_fits_with_the_parameter_held() -> None:
    kind, records, fit = fitted()
    found = {one.name: one for one in profiles(kind, fit, [], records)}
    assert set(found) == {"hoop_stress_factor", "friction_coefficient"}
    one = found["friction_coefficient"]
    assert not one.unshown
    whole = Fitter.of(kind, records, [], kind.final)
    free = [axis for axis in whole.axes if axis.name != "friction_coefficient"]
    for value, drop in (pair for pair in zip(one.values, one.drops, strict=True) if pair[1] > 1):
        held = replace(whole, axes=free).near(fit.theta | {"friction_coefficient": value})
        real = (held.cost - fit.cost) / (2 * max(fit.chi2, 1.0) * memory(fit.residual))
        assert drop == pytest.approx(real, rel=0.35, abs=0.3)
    assert max(one.drops[0], one.drops[-1]) > LINE > min(one.drops)


def test_what_the_records_do_not_hold_is_flat() -> None:
    kind, records, fit = fitted("viscous_drag")
    found: dict[str, Profile] = {one.name: one for one in profiles(kind, fit, ["viscous_drag"], records)}
    assert found["viscous_drag.coefficient_N"].unshown == ("lower",)
    assert max(found["viscous_drag.exponent"].drops) < LINE
    assert max(found["friction_coefficient"].drops) > LINE
