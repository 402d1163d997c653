"""Parameter sets and printed measurements: they load, say what they are not, and a miss names the nearest key."""

import numpy as np
import pytest

from models.parameter import SETS, Parameter, load_set
from models.sets import MEASURED, load_measurement, measured_path


@pytest.mark.parametrize("name", [path.stem for path in sorted(SETS.glob("*.toml"))])
def test_every_set_says_what_it_is_and_is_not(name):
    parameters = load_set(name)
    assert all((parameters.title, parameters.source, parameters.caution))
    assert parameters.parameters
    for parameter in parameters.parameters.values():
        assert parameter.unit
        assert parameter.source
        assert np.isfinite(parameter.value)


def test_a_miss_names_the_nearest():
    with pytest.raises(ValueError, match="did you mean 'zhang2016_analytical'"):
        load_set("zhang2016_analytic")
    with pytest.raises(KeyError, match="did you mean 'k1_coll_Pa'"):
        load_set("zhang2016_analytical")["k1_col_Pa"]
    with pytest.raises(ValueError, match="did you mean 'viscoelastic_table2_dma'"):
        load_measurement("viscoelastic_table2")
    with pytest.raises(KeyError, match="did you mean 'valley_N'"):
        load_measurement("analytical_table2_periods")["valley"]


def test_a_parameter_keeps_its_bounds():
    mu = Parameter("mu", 0.082, lower=0.0, upper=1.0)
    assert mu.at(0.1).value == 0.1
    with pytest.raises(ValueError, match=r"mu must lie in \[0, 1\] 1; got 2"):
        mu.at(2.0)


def test_measurements_are_the_printed_ones():
    periods = load_measurement("analytical_table2_periods")
    assert len(periods["period_s"]) == 8
    assert periods["period_s"].mean() == pytest.approx(0.0912, abs=5e-5)
    assert periods["valley_N"].mean() == pytest.approx(22.68e-3, abs=5e-6)
    assert periods["peak_N"].mean() == pytest.approx(35.09e-3, abs=5e-6)
    dma = load_measurement("viscoelastic_table2_dma")
    dip = dma.select(frequency_Hz=40)["storage_modulus_Pa"]
    assert np.all(dip < dma.select(frequency_Hz=30)["storage_modulus_Pa"])
    assert np.all(dip < dma.select(frequency_Hz=50)["storage_modulus_Pa"])


@pytest.mark.parametrize("name", [path.stem for path in sorted(MEASURED.glob("*.csv"))])
def test_every_measurement_has_its_header(name):
    table = load_measurement(name)
    assert all((table.title, table.source, table.caution))
    assert measured_path(name).read_text(encoding="utf-8").splitlines()[0].split(",") == list(table.units)
    assert len({len(column) for column in table.columns.values()}) == 1
