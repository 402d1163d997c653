"""Effects from a user's file: what is refused, in a sentence, and what a model file keeps of them."""

import pickle
import re
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from models.effects import CATALOGUE, Catalogue
from models.effects.effect import Effect
from models.identification.kinds.dma import DmaKind
from models.identification.model import Model, own_effects_of
from models.records.record import Record
from models.rigs.rig import Rig
from models.theta import Theta
from tests.places import ROOT

EXAMPLE = ROOT / "examples" / "own_effect" / "soft_bump.py"
TEXT = EXAMPLE.read_text(encoding="utf-8")
KINDS = '"pull", "magnetic", "coil", "vibro"'


def own_file(folder: Path, *changes: tuple[str, str]) -> Path:
    """The example with `changes` (old, new) in a file of its own."""
    text = TEXT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path = folder / "mine.py"
    path.write_text(text, encoding="utf-8")
    return path


def own(*paths: Path) -> list[type[Effect]]:
    return [origin.effect for origin in Catalogue.read(paths).own]


def test_it_takes_part_where_its_catalogue_is_given() -> None:
    catalogue = Catalogue.read([EXAMPLE])
    bump = catalogue["soft_bump"]
    assert all(bump in catalogue.acting_on(kind) for kind in ("pull", "magnetic", "coil", "vibro"))
    assert bump not in catalogue.acting_on("axis")
    assert "soft_bump" not in CATALOGUE
    assert bump not in CATALOGUE.acting_on("pull")


def test_another_process_reads_its_file_again() -> None:
    rig = Catalogue.read([EXAMPLE]).given_to(Rig("pull"))
    again = pickle.loads(pickle.dumps(rig))
    assert Catalogue.of(again)["soft_bump"].parameters() == Catalogue.of(rig)["soft_bump"].parameters()
    assert [origin.sha256 for origin in again.own_effects] == [origin.sha256 for origin in rig.own_effects]


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            [("class SoftBump(Effect)", "class SoftBump")],
            "must have a subclass of models.effects",
        ),
        ([('id = "soft_bump"', 'id = "stenosis"')], "id must be one that is free; got 'stenosis'"),
        (
            [("s: Signals, p: Values, z: Values)", "s: Signals, p: Values)")],
            "must take",
        ),
        ([("return p[", "if s.x > 0: return 0.0\n        return p[")], "must trace to CasADi symbols"),
        ([("return p[", "return 1e-3 + p[")], "must be 0 (no effect) where force_N is 0; got 0.001"),
        ([('"force_N", 0.0,', '"force_N", 0.1,')], "the amplitude, must start at 0"),
        ([("probe = 0.01", "probe = 5.0")], "probe must be an amplitude within its bounds"),
        ([('"coil", "vibro"', '"coil", "submarine"')], "kinds must be among"),
        ([('"coil", "vibro"', '"coil", "vibro_table"')], "kinds must not have 'vibro_table'"),
        (
            [('"stenosis", "incline_gravity"', '"stenoses", "incline_gravity"')],
            "ids of known effects; got 'stenoses'",
        ),
        ([("import numpy as np", "import nothing_of_that_name")], "ModuleNotFoundError"),
        ([("class SoftBump", "class class")], "SyntaxError"),
        ([('summary = "a soft bump that pushes the capsule away from its middle"', "")], "summary must say"),
        ([('p["place_m"]', 'p["place"]')], "KeyError in force, line 34: 'place'; did you mean 'place_m'?"),
        (
            [("return p[", "return np.sqrt(p['force_N']) * p[")],
            "force must be finite; got nan on coil at force_N = -0.1",
        ),
        (
            [("def force", "def forse")],
            "SoftBump.forse must be a hook, or begin with an underscore where it is its own; did",
        ),
        (
            [("confounders =", "confouders =")],
            "must be a declaration, or begin with an underscore where it is its own; did",
        ),
        ([(KINDS, '"dma"')], "kinds must be rigs that call its hooks; got 'dma', which calls modulus, never force"),
        ([("def force", "def gain"), ("return p[", "return 1 + p[")], "got 'pull', which calls level, "),
        ([("s.x", "s.load")], "got nothing at its probe on 'coil', which has no load"),
        ([(f"frozenset({{{KINDS}}})", KINDS)], "kinds must be a set of kinds of rig"),
        ([(KINDS, "*()")], "kinds must be among pull, magnetic, coil, vibro, vibro_table, axis, periods"),
        ([("return p[", "return np.nan * p[")], "force must be finite; got nan on coil"),
        (
            [("return p[", "return 0 * np.log(np.abs(s.v)) + p[")],
            "direction = 1",
        ),
        ([("return p[", "return np.ones(2) * p[")], "force must return one number; got ndarray"),
        ([("return p[", "return 0.0 * p[")], "must use each parameter; got 'force_N'"),
        ([('/ p["width_m"]', "/ 1e-3")], "must use each parameter; got 'width_m'"),
        ([("return p[", "raise SystemExit(0)\n        return p[")], "must run; got SystemExit in force, line 35: 0"),
        ([('0.0, "N"', '0.0, "Newtonish"')], "force_N must have a unit, such as N, m/s or 1; got 'Newtonish'"),
        ([("-0.2, 0.2", "0.2, -0.2")], "force_N must have its lower bound first; got 0.2, -0.2"),
        ([('Parameter("force_N"', 'Parameter("force"')], "force_N must have a parameter of the same name; got 'force'"),
        ([('"place_m": (', '"place": (')], "grid must name parameters; got 'place'; did you mean 'place_m'?"),
        ([("-9e-3, -6e-3", "-9, -6e-3")], "grid must have starts of place_m in [-0.1, 0.1]"),
        (
            [("probe =", 'needs = ("place",)\n    probe =')],
            "needs must be among its choices; got 'place'; did you mean",
        ),
        (
            [("probe =", 'states = ("heat",)\n    probe =')],
            "states must each be given by advance or follow; got 'heat'",
        ),
        ([('("stenosis", "incline_gravity")', '"stenosis"')], "confounders must be a tuple of names"),
        (
            [("force(self, s: Signals, p: Values, z: Values)", "reach(self, stretch, p)")],
            "must be a subclass of InnerMass",
        ),
    ],
)
def test_what_cannot_be_used_is_refused_in_a_sentence(
    tmp_path: Path, changes: list[tuple[str, str]], sentence: str
) -> None:
    path = own_file(tmp_path, *changes)
    with pytest.raises(ValueError, match=r"mine\.py") as refused:
        own(path)
    assert sentence in str(refused.value)
    assert "\n" not in str(refused.value)


def test_its_numbers_may_be_plain_attributes(tmp_path: Path) -> None:
    plain = [("@dataclass(frozen=True)\n", ""), ("Signals, Values", "Signals, Values, number"), (": Parameter", "")]
    named = [(f'Parameter("{name}", ', "number(") for name in ("force_N", "place_m", "width_m")]
    (field,) = own(EXAMPLE)
    (bump,) = own(own_file(tmp_path, *plain, *named))
    assert bump.parameters() == field.parameters()


def test_two_effects_of_a_file_take_part_and_may_name_each_other(tmp_path: Path) -> None:
    first = ('("stenosis", "incline_gravity")', '("firm_bump",)')
    path = own_file(tmp_path, first)
    second = TEXT[TEXT.index("@dataclass") :].replace("soft_bump", "firm_bump").replace("SoftBump", "FirmBump")
    path.write_text(path.read_text() + "\n\n" + second)
    assert [effect.id for effect in own(path)] == ["soft_bump", "firm_bump"]
    path.write_text(path.read_text().replace("firm_bump", "soft_bump"))
    with pytest.raises(ValueError, match=r"got 'soft_bump', which mine\.py has"):
        own(path)


MODULUS = """
    def modulus(self, frequency_Hz: Any, p: Values) -> DynamicModulus:
        size = p["force_N"] * frequency_Hz / (1 + p["place_m"] ** 2 + p["width_m"])
        return DynamicModulus(size, 0.1 * size)
"""


def test_an_own_effect_on_a_dma_is_asked_for_its_modulus(tmp_path: Path) -> None:
    path = own_file(tmp_path, (KINDS, '"dma"'), ('"N", -0.2, 0.2', '"Pa", 0.0, 1e6'), ("probe = 0.01", "probe = 1e3"))
    text = path.read_text()
    imported = "from models.laws.five_elements import DynamicModulus\nfrom models.parameter"
    path.write_text(text[: text.index("    def force")].replace("from models.parameter", imported) + MODULUS)
    kind = DmaKind.from_rig(Catalogue.read([path]).given_to(Rig("dma")))
    record = Record("sweep", "dma", {"frequency_Hz": np.array([1.0, 10.0])})
    base = kind.nominal()
    added = kind.predict(record, base.with_("soft_bump", {"force_N": 1e4, "place_m": 0.0, "width_m": 2e-3}))
    np.testing.assert_allclose(added - kind.predict(record, base), np.outer([1e4, 1e5], [1, 0.1]) / 1.002)


def test_two_files_with_one_id_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="free"):
        own(EXAMPLE, own_file(tmp_path))


@pytest.mark.parametrize("name", ["none.py", "folder.py", "mine.txt"])
def test_a_file_that_is_none_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder.py").mkdir()
    (tmp_path / "mine.txt").write_text(TEXT)
    with pytest.raises(
        ValueError, match=r"must be a regular file|must be a file that can be read|effects must come from a file"
    ):
        own(tmp_path / name)


def test_a_model_file_asks_for_the_same_file(tmp_path: Path) -> None:
    catalogue = Catalogue.read([EXAMPLE])
    values = Theta.of({"friction_coefficient": 0.08, ("soft_bump", "force_N"): 0.01})
    thetas = {"nominal": Theta(), "calibrated": Theta(), "augmented": values}
    text = Model("pull", thetas, own_effects=own_effects_of(thetas, catalogue)).to_toml()
    assert Model.from_toml(text, catalogue).stages == thetas
    with pytest.raises(ValueError, match=r"must stand with --effects soft_bump\.py"):
        Model.from_toml(text)
    with pytest.raises(ValueError, match="got another"):
        Model.from_toml(text, Catalogue.read([own_file(tmp_path, ("2e-3,", "3e-3,"))]))


@pytest.mark.parametrize(
    ("value", "sentence"),
    [
        ("no_such_module:Bump", "ModuleNotFoundError"),
        ("math:no_such_name", "AttributeError"),
        ("math:sin", "not a class"),
        ("fractions:Fraction", "must be a subclass of models.effects.effect.Effect; got Fraction"),
    ],
)
def test_what_a_package_offers_and_cannot_be_used_is_told(
    monkeypatch: pytest.MonkeyPatch, value: str, sentence: str
) -> None:
    points = [EntryPoint("bump", value, "capsule.effects")]
    monkeypatch.setattr("models.files.python_file.entry_points", lambda group: points)
    with pytest.raises(ValueError, match=re.escape(sentence)):
        own()


def test_what_a_package_offers_takes_part(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "offered_bump.py").write_text(TEXT)
    monkeypatch.syspath_prepend(str(tmp_path))
    points = [EntryPoint("bump", "offered_bump:SoftBump", "capsule.effects")]
    monkeypatch.setattr("models.files.python_file.entry_points", lambda group: points)
    assert [effect.id for effect in own()] == ["soft_bump"]
