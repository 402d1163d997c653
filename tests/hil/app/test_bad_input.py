"""Records, models and outputs that make no sense: status 2 and one sentence that names the file, before any long
work.
"""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hil.app.main import run
from models.identification import Model
from models.identification.kinds import kind_for
from models.identification.model import sealed
from models.parameter import Parameter
from models.records.record import Record
from models.rigs.reader import read_rig
from models.theta import Theta
from tests.rig_texts import GUT, PLATE

TABLES = {
    "axis": "",
    "dma": "",
    "friction": "",
    "periods": "velocity_m_s = 0.0005\n",
    "pull": GUT,
    "magnetic": "magnet_stiffness_N_per_m = 25.0\nmagnet_range_m = 0.02\n" + GUT,
    "coil": "force_constant_N_per_A = 0.5\n" + GUT,
    "vibro": PLATE,
    "vibro_table": PLATE,
}
T = 0.002 * np.arange(1500)
X = 0.05 * np.sin(4.4 * T)
F = 100 * np.cos(4.4 * T)
LONG = 0.75 * np.arange(5000)
PERIODS = "0.085,0.0200,0.0318\n0.093,0.0221,0.0345\n0.090,0.0212,0.0330\n0.097,0.0231,0.0352\n0.088,0.0209,0.0327\n"
DMA = "".join(f"{f},{s},{4e5 + 1e3 * f + s},{3e5 + 2e3 * f}\n" for s in (1, 2) for f in (20, 30, 40, 50, 60))
SPEEDS = "".join(f"{0.03 + 0.01 * k:g},0.3,20,{0.001 * k:g}\n" for k in range(8))
HEADS = {
    "periods": "period_s,valley_N,peak_N\n",
    "dma": "frequency_Hz,sample,storage_modulus_Pa,loss_modulus_Pa\n",
    "vibro_table": "period_s,duty,cycles,mean_velocity_m_s\n",
    "friction": "velocity_m_s,load_N,force_N\n",
}


def series(t: np.ndarray = T, x: np.ndarray = X, f: np.ndarray = F, header: str = "t_s,position_m,force_N") -> str:
    rows = zip(t, x, f, strict=True)
    return header + "\n" + "".join(f"{a:.16g},{b:.16g},{c:.16g}\n" for a, b, c in rows)


@pytest.fixture
def rig(tmp_path: Path) -> Callable[[str], str]:
    def write(kind: str) -> str:
        path = tmp_path / f"{kind}.toml"
        path.write_text(f'[rig]\nkind = "{kind}"\n{TABLES[kind]}')
        return str(path)

    return write


def refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one sentence with which a command line is refused."""
    capsys.readouterr()
    assert run(words) == 2
    said = capsys.readouterr()
    assert said.out == "" or json.loads(said.out)["status"] == 2
    sentences = [line for line in said.err.splitlines() if line.startswith("capsule:")]
    assert len(sentences) == 1
    assert "Traceback" not in said.err
    return sentences[0]


BAD_RECORDS = {
    "axis, still": ("axis", series(x=0 * X), "position_m must change to identify anything; got 0 throughout"),
    "axis, dead sensor": ("axis", series(f=0 * F + 3), "force_N must change to identify anything; got 3 throughout"),
    "axis, too short": ("axis", series(T[:100], X[:100], F[:100]), "a training and a validation part"),
    "axis, huge position": ("axis", series(x=X * 1e150), "line 3: position_m must be between -100 and 100 m"),
    "axis, huge force": ("axis", series(f=F * 1e200), "line 2: force_N must be between -1e6 and 1e6 N"),
    "axis, gap": (
        "axis",
        series(np.where(T > 1.5, T + 3600, T)),
        "t_s must go on without a gap; got none between 1.5 s",
    ),
    "axis, holes": ("axis", series(T + 0.2 * np.floor(10 * T)), "t_s must be evenly spaced"),
    "axis, ms": ("axis", series(T * 1e6, f=F / 1e3), "t_s must step by 1 µs to 1 s"),
    "axis, time": ("axis", series(header="time,position_m,force_N"), "where it has 'time', did you mean 't_s'?"),
    "axis, time_s": ("axis", series(header="time_s,position_m,force_N"), "where it has 'time_s', did you mean 't_s'?"),
    "pull, too fine a clock": ("pull", series(T * 1e-9, f=F / 1e3), "t_s must step by 1 µs to 1 s"),
    "pull, ms": ("pull", series(T * 1e6, f=F / 1e3), "t_s must step by 1 µs to 1 s; got steps of 2000 s"),
    "pull, long": (
        "pull",
        series(LONG, 1e-5 * LONG, np.sqrt(LONG) / 1e3),
        "t_s must span at most 3600 s for kind pull; got 3749.25 s",
    ),
    "pull, still": ("pull", series(x=0 * X, f=F / 1e3), "position_m must change"),
    "dma, identical rows": ("dma", HEADS["dma"] + "20,1,5e5,4e5\n" * 5, "a training and a validation part"),
    "dma, few": (
        "dma",
        HEADS["dma"] + "20,1,5e5,4e5\n30,1,6e5,4e5\n40,1,7e5,4e5\n",
        "more numbers than the 5 that are fitted",
    ),
    "friction, one condition": (
        "friction",
        HEADS["friction"] + "0.001,0.2,0.02\n" * 6,
        "a training and a validation part",
    ),
    "friction, at rest": (
        "friction",
        HEADS["friction"] + "0,0.2,0.02\n" + "0.001,0.2,0.02\n0.002,0.2,0.02\n" * 3,
        "between -1000 and 1000 m/s and not 0",
    ),
    "friction, no load": (
        "friction",
        HEADS["friction"] + "0.001,0,0.02\n0.001,0.2,0.02\n0.002,0.2,0.02\n" * 2,
        "positive, at most 1e9 N",
    ),
    "table, one condition": (
        "vibro_table",
        HEADS["vibro_table"] + "0.03,0.3,100,0.003\n" * 6,
        "a training and a validation part",
    ),
    "table, two conditions": (
        "vibro_table",
        HEADS["vibro_table"] + "0.03,0.3,100,0.003\n0.04,0.3,100,0.003\n" * 3,
        "more numbers than the 3 that are fitted",
    ),
    "table, at rest": (
        "vibro_table",
        HEADS["vibro_table"] + "0.03,0.3,100,0\n0.04,0.3,100,0\n" * 3,
        "must differ from 0",
    ),
    "table, long": (
        "vibro_table",
        HEADS["vibro_table"] + SPEEDS + "9999,0.5,100,0.003\n",
        "must span at most 100000 s",
    ),
    "table, fast": (
        "vibro_table",
        HEADS["vibro_table"] + SPEEDS + "0.03,0.5,100,1e200\n",
        "line 10: mean_velocity_m_s must be",
    ),
    "periods, one row": ("periods", HEADS["periods"] + "0.1,0.02,0.03\n" * 6, "must scatter as measured ones do"),
    "periods, peak below": (
        "periods",
        HEADS["periods"] + PERIODS + "0.1,0.03,0.02\n",
        "line 7: peak_N must be above valley_N",
    ),
    "periods, mN": (
        "periods",
        HEADS["periods"] + "".join(f"0.09,{20 + k},{32 + 2 * k}\n" for k in range(5)),
        "valley_N reaches 24 N; such rigs have 0 N to 5 N",
    ),
    "periods, speed": (
        "periods",
        "velocity_m_s,"
        + HEADS["periods"]
        + "".join(f"{v},{row}\n" for v, row in zip((1e-3, 0, 1e-3), PERIODS.split(), strict=False)),
        "line 3: velocity_m_s must be the speed of the pull",
    ),
    "periods, Latin-1": ("periods", "p\u00e9riode_s,valley_N,peak_N\n" + PERIODS, "was read as Windows-1252"),
}


@pytest.mark.parametrize("name", BAD_RECORDS)
def test_a_record_that_tells_nothing_is_refused(
    tmp_path: Path, rig: Callable[[str], str], name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    kind, content, words = BAD_RECORDS[name]
    path = tmp_path / "bad.csv"
    path.write_bytes(content.encode("latin-1"))
    said = refused(["close-loop", str(path), "--rig", rig(kind), "--out", str(tmp_path / "o")], capsys)
    assert "bad" in said
    assert words in said
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda x: 0 * x, "force_N must change"),
        (lambda x: x[:20], "at least 100 rows"),
        (lambda x: x[:100], "at least"),
    ],
    ids=["dead", "few rows", "short"],
)
def test_held_out_records_are_looked_through_first(
    tmp_path: Path,
    rig: Callable[[str], str],
    spoil: Callable[[np.ndarray], np.ndarray],
    words: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    n = len(spoil(F))
    (tmp_path / "train.csv").write_text(series())
    (tmp_path / "held.csv").write_text(series(T[:n] / (10 if n == 100 else 1), X[:n], spoil(F)))
    files = [str(tmp_path / "train.csv"), "--holdout", str(tmp_path / "held.csv")]
    said = refused(["close-loop", *files, "--rig", rig("axis"), "--out", str(tmp_path / "o")], capsys)
    assert "held" in said
    assert words in said


def driven(kind: str) -> str:
    """A short record of the driven columns alone."""
    rows = {
        "periods": "velocity_m_s\n0.0005\n",
        "dma": "frequency_Hz\n20\n",
        "friction": "velocity_m_s,load_N\n0.001,0.2\n",
        "vibro_table": "period_s,duty,cycles\n0.05,0.3,2\n",
    }
    column = {"magnetic": "carriage_position_m", "coil": "coil_current_A", "vibro": "drive_on"}.get(kind, "position_m")
    return rows.get(kind, f"t_s,{column}\n" + "".join(f"{0.01 * i:.2f},{0.001 * (i % 30):.3f}\n" for i in range(60)))


@pytest.fixture
def model(tmp_path: Path, rig: Callable[[str], str]) -> Callable[[str], Path]:
    """A model file of a kind as close-loop writes one, its first effect added, with every number at one of its
    bounds.
    """

    def write(kind: str) -> Path:
        belief = read_rig(Path(rig(kind)))
        columns = [line.split(",") for line in driven(kind).split()]
        values = np.array(columns[1:], dtype=float).T
        work = kind_for(belief, [Record("r", kind, dict(zip(columns[0], values, strict=True)))])
        effect = work.effects[0]
        fitted = Theta.of({(effect.id, p.name): bound(p) for p in effect.parameters() if p.fit})
        base = Theta.of((p.key, bound(p)) for p in work.base)
        path = tmp_path / "model.toml"
        path.write_text(
            Model(kind, {"nominal": work.nominal(), "calibrated": base, "augmented": base | fitted}).to_toml()
        )
        (tmp_path / "driven.csv").write_text(driven(kind))
        return path

    return write


def bound(p: Parameter) -> float:
    return p.upper if np.isfinite(p.upper) else p.value


@pytest.mark.parametrize("kind", TABLES)
def test_models_of_all_kinds_are_read_up_to_their_bounds(
    tmp_path: Path,
    rig: Callable[[str], str],
    model: Callable[[str], Path],
    kind: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = [
        "--rig",
        rig(kind),
        "--model",
        str(model(kind)),
        "--out",
        str(tmp_path / "p.csv"),
        "--json",
        "--stage",
        "nominal",
    ]
    assert run(["predict", str(tmp_path / "driven.csv"), *words]) == 0, capsys.readouterr().err
    assert json.loads(capsys.readouterr().out)["rows"] == len(driven(kind).split()) - 1


BAD_MODELS = {
    "missing": (lambda text: without(text, "coulomb_friction_N"), "[nominal] must have the key 'coulomb_friction_N'"),
    "strange": (lambda text: text.replace("offset_N", "ofset_N"), "got 'ofset_N'; did you mean 'offset_N'?"),
    "out of bounds": (
        lambda text: text.replace('"mass_kg" = 10.0', '"mass_kg" = -1.0'),
        "mass_kg must lie in [0.0001, 1000] kg",
    ),
    "effect misspelt": (
        lambda text: text.replace(".asymmetry", ".asymetry"),
        "got 'directional_asymmetry.asymetry'; did you mean 'directional_asymmetry.asymmetry'?",
    ),
    "effect out of bounds": (
        lambda text: text + '\n"stribeck.excess" = 99.0\n"stribeck.speed_m_s" = 0.01\n',
        "stribeck.excess must lie",
    ),
    "effect incomplete": (lambda text: text + '\n"stribeck.excess" = 0.1\n', "must have the key 'stribeck.speed_m_s'"),
    "effect of another kind": (
        lambda text: text + '\n"wall_viscosity.viscosity_N_s_per_m" = 0.1\n',
        "effects that can act on a rig of kind axis",
    ),
}


def without(text: str, name: str) -> str:
    return "\n".join(line for line in text.splitlines() if name not in line)


@pytest.mark.parametrize("name", BAD_MODELS)
def test_a_model_with_wrong_numbers_is_refused(
    tmp_path: Path,
    rig: Callable[[str], str],
    model: Callable[[str], Path],
    name: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    spoil, words = BAD_MODELS[name]
    path = model("axis")
    path.write_text(spoil(path.read_text()))
    out = tmp_path / "p.csv"
    said = refused(
        ["predict", str(tmp_path / "driven.csv"), "--rig", rig("axis"), "--model", str(path), "--out", str(out)], capsys
    )
    assert "model.toml: " in said
    assert words in said
    assert not out.exists()


def test_no_command_overwrites_what_it_reads(
    tmp_path: Path, rig: Callable[[str], str], model: Callable[[str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    record, rig_file, learned = tmp_path / "driven.csv", rig("axis"), model("axis")
    link = tmp_path / "link.csv"
    link.symlink_to(record)
    before = record.read_text()
    for out in (record, tmp_path / "." / "driven.csv", link):
        words = ["predict", str(record), "--rig", rig_file, "--model", str(learned), "--out", str(out)]
        assert "--out must not be a file that is read" in refused(words, capsys)
    scenario = tmp_path / "scenario.csv"
    scenario.write_text("")
    assert "scenario.csv" in refused(["simulate", str(scenario), "--out", str(scenario)], capsys)
    Path(rig_file).rename(tmp_path / "model.toml")
    words = ["close-loop", str(record), "--rig", str(tmp_path / "model.toml"), "--out", str(tmp_path)]
    assert "--out must not be a file that is read" in refused(words, capsys)
    assert record.read_text() == before


def test_targets_are_checked_before_any_work(
    tmp_path: Path, rig: Callable[[str], str], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "o" / "report.html").mkdir(parents=True)
    (tmp_path / "r.csv").write_text(series())
    words = ["close-loop", str(tmp_path / "r.csv"), "--rig", rig("axis"), "--out"]
    assert "the name report.html free" in refused([*words, str(tmp_path / "o")], capsys)
    assert "--out must name a file or a folder" in refused([*words, ""], capsys)


def test_a_stage_with_jittered_times_is_evened_out(
    tmp_path: Path, rig: Callable[[str], str], model: Callable[[str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    learned, out = model("axis"), tmp_path / "p.csv"
    learned.write_text(sealed(without(learned.read_text(), "directional_asymmetry")))
    late = T + np.random.default_rng(0).uniform(-4e-4, 4e-4, len(T))
    forces = []
    for t in (T, late):
        (tmp_path / "r.csv").write_text(series(t, 0.05 * np.sin(4.4 * t), F))
        assert (
            run(
                [
                    "predict",
                    str(tmp_path / "r.csv"),
                    "--rig",
                    rig("axis"),
                    "--model",
                    str(learned),
                    "--out",
                    str(out),
                    "--stage",
                    "nominal",
                ]
            )
            == 0
        )
        forces.append(np.loadtxt(out, delimiter=",", skiprows=1)[:, 1])
    np.testing.assert_allclose(forces[1][50:-50], forces[0][50:-50], atol=0.1 * np.abs(forces[0]).max())
    assert capsys.readouterr().err.count("capsule:") == 0
