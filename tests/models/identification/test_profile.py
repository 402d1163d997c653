"""Profile likelihoods: as high as real fits with a parameter held, and flat where records hold nothing."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from models.identification.finding import Profile
from models.identification.fitting.fit import Fit
from models.identification.fitting.fitter import Fitter
from models.identification.intervals import memory
from models.identification.kinds import kind_for
from models.identification.kinds.reports import AnyKind
from models.identification.profile import LINE, profiles
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.theta import Theta
from tests.rig_texts import GUT

RIG = parse_rig(tomllib.loads(f'{GUT}\n[rig]\nkind = "pull"\n[noise]\nforce_std_N = 1e-3\n'))


def fitted(*effects: str) -> tuple[AnyKind, list[Record], Fit]:
    t = np.arange(0, 8, 2e-3)
    x = 3e-3 * (1 - np.cos(2 * np.pi * t / 4))
    blank = Record("pull", "pull", {"t_s": t, "position_m": x, "force_N": np.zeros_like(t)})
    kind = replace(kind_for(RIG, [blank]), noise_std=1e-3)
    truth = kind.nominal() | Theta({"hoop_stress_factor": 1.05, "friction_coefficient": 0.08})
    record = kind.imitate(blank, truth, np.random.default_rng(0))
    kind, start = kind_for(RIG, [record]), truth
    for name in effects:
        start = start.with_(name, kind.declared(name).start() | {kind.declared(name).amplitude().name: 1e-4})
    return kind, [record], Fitter.of(kind, [record], effects, kind.final).near(start)


def axis() -> tuple[AnyKind, list[Record], Fit]:
    """A stage of 10 kg, to and fro, and the fit of its four numbers."""
    rig = parse_rig({"rig": {"kind": "axis"}, "noise": {"force_std_N": 0.3}})
    t = np.arange(0, 8, 1e-2)
    x = 0.05 * np.sin(2 * np.pi * 0.3 * t) + 0.02 * np.sin(2 * np.pi * 0.7 * t)
    v = np.gradient(x, t)
    noise = 0.3 * np.random.default_rng(0).standard_normal(len(t))
    force = 10 * np.gradient(v, t) + 20 * v + 8 * np.sign(v) + 1 + noise
    record = Record("stage", "axis", {"t_s": t, "position_m": x, "force_N": force})
    kind = kind_for(rig, [record])
    return kind, [record], Fitter.of(kind, [record], [], kind.final).near(kind.nominal())


def test_a_profile_is_that_of_fits_with_the_parameter_held() -> None:
    kind, records, fit = axis()
    found = profiles(kind, fit, [], records)
    assert len(found) == 4
    whole = Fitter.of(kind, records, [], kind.final)
    for one in found:
        free = [other for other in whole.axes if other.name != one.name]
        for value, drop in zip(one.values, one.drops, strict=True):
            held = replace(whole, axes=free).near(fit.theta | {one.name: value})
            real = (held.cost - fit.cost) / (2 * max(fit.chi2, 1.0) * memory(fit.residual))
            assert drop == pytest.approx(real, rel=0.1, abs=0.1)
        assert max(one.drops[0], one.drops[-1]) > LINE > min(one.drops)
        assert not one.unshown


def test_what_the_records_do_not_hold_is_flat() -> None:
    kind, records, fit = fitted("viscous_drag")
    found: dict[str, Profile] = {one.name: one for one in profiles(kind, fit, ["viscous_drag"], records)}
    assert found["viscous_drag.coefficient_N"].unshown == ("lower",)
    assert max(found["viscous_drag.exponent"].drops) < LINE
    assert max(found["friction_coefficient"].drops) > LINE
