"""Rig files: what is read, and one sentence for everything that is wrong."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.laws.geometry import Capsule, Tissue
from models.rigs.reader import parse_rig, read_rig
from models.rigs.rig import Rig
from tests.rig_texts import PLATE

VIBRO_TABLE = PLATE + '[rig]\nkind = "vibro_table"\n'


def read(folder: Path, text: str | bytes) -> Rig:
    path = folder / "rig.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_rig(path)


def test_reads_a_magnetic_rig(tmp_path: Path, rig_text: str) -> None:
    rig = read(tmp_path, rig_text)
    assert (rig.kind, rig.capsule, rig.tissue) == ("magnetic", Capsule(), Tissue())
    assert rig.magnet is not None
    assert (rig.magnet.magnet_stiffness_N_per_m, rig.magnet.magnet_range_m) == (25.0, 0.02)
    assert (rig.noise.position_std_m, rig.noise.force_std_N) == (5e-5, None)


PAIR = """[rig.magnet]
outer_moment_A_m2 = 400.0
inner_moment_A_m2 = 1.0
height_m = 0.15
"""


def paired(rig_text: str, pair: str = PAIR) -> str:
    return rig_text.replace("magnet_stiffness_N_per_m = 25.0\nmagnet_range_m = 0.02\n", pair)


def test_two_magnets_give_stiffness_and_range(tmp_path: Path, rig_text: str) -> None:
    """12 mu_0/(4 pi) m_1 m_2/h^5, and sqrt(3) times the gap of greatest pull, 0.389 h."""
    rig = read(tmp_path, paired(rig_text))
    assert rig.magnet is not None
    assert rig.magnet.magnet_stiffness_N_per_m == pytest.approx(12e-7 * 400 / 0.15**5)
    assert rig.magnet.magnet_range_m == pytest.approx(3**0.5 * 0.3893 * 0.15, rel=1e-3)
    along = read(tmp_path, paired(rig_text, PAIR + 'moments = "along"\n'))
    assert along.magnet is not None
    assert along.magnet.magnet_stiffness_N_per_m == pytest.approx(9e-7 * 400 / 0.15**5)
    size = "outer_remanence_T = 1.3\nouter_diameter_m = 0.1\nouter_length_m = 0.1\n"
    sized = read(tmp_path, paired(rig_text, PAIR.replace("outer_moment_A_m2 = 400.0\n", size)))
    assert sized.magnets is not None
    assert sized.magnets.moment("outer") == pytest.approx(812.5, rel=1e-3)
    measured = read(tmp_path, paired(rig_text, "magnet_stiffness_N_per_m = 7.0\n" + PAIR))
    assert measured.magnet is not None
    assert measured.magnet.magnet_stiffness_N_per_m == 7.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("outer_moment_A_m2 = 400.0", "", r"must have outer_moment_A_m2, or .* and not both; got neither"),
        ("height_m", "outer_length_m = 0.1\nheight_m", "not both; got outer_moment_A_m2, outer_length_m"),
        ("height_m = 0.15", "", r"\[rig.magnet\] must have the key 'height_m'"),
        ("height_m = 0.15", "heigth_m = 0.15", r"'heigth_m'; did you mean 'height_m'"),
        ("[rig.magnet]", "magnet_range_m = 0.02\n[rig.magnet]", "'magnet_range_m'"),
        ("height_m = 0.15", "height_m = 0.15\nheight_range_m = [0.16, 0.2]", "with height_m = 0.15 between"),
        ("height_m = 0.15", "height_m = 0.15\nheight_range_m = [0.1, 0.2]", "'pressing_limit_N'"),
        ("height_m = 0.15", 'height_m = 0.15\nmoments = "up"', "moments must be one of 'across' or 'along'"),
    ],
)
def test_what_is_wrong_with_two_magnets_is_one_sentence(
    tmp_path: Path, rig_text: str, old: str, new: str, message: str
) -> None:
    with pytest.raises(ValueError, match=f"rig.toml: .*{message}"):
        read(tmp_path, paired(rig_text, PAIR.replace(old, new)))


@pytest.mark.parametrize("kind", ["plate", "air", "gut"])
def test_a_magnetic_rig_may_lie_on_a_surface(tmp_path: Path, rig_text: str, kind: str) -> None:
    friction = "friction_coefficient = 0.3\n" if kind == "plate" else ""
    rig = read(tmp_path, rig_text + f'\n[surface]\nkind = "{kind}"\n{friction}')
    assert rig.surface is not None
    assert rig.surface.kind == kind
    with pytest.raises(ValueError, match=r"\[surface\] must have the key 'friction_coefficient'"):
        read(tmp_path, rig_text + '\n[surface]\nkind = "plate"\n')


def test_lumen_diameter_stands_for_the_contact_angle(tmp_path: Path, rig_text: str) -> None:
    text = rig_text.replace("contact_angle_deg = 60.0", "lumen_diameter_m = 9e-3")
    assert read(tmp_path, text).tissue.contact_angle_deg == pytest.approx(46.2, abs=0.02)
    with pytest.raises(
        ValueError, match=r"rig.toml: \[tissue\] must have lumen_diameter_m or contact_angle_deg; got both"
    ):
        read(
            tmp_path, rig_text.replace("contact_angle_deg = 60.0", "contact_angle_deg = 60.0\nlumen_diameter_m = 9e-3")
        )
    with pytest.raises(
        ValueError, match=r"lumen_diameter_m must be positive and less than the capsule's 0.013 m; got 0.02"
    ):
        read(tmp_path, text.replace("9e-3", "20e-3"))


def test_regime_of_the_moduli(tmp_path: Path, rig_text: str) -> None:
    assert read(tmp_path, rig_text).tissue.regime == "low"
    text = rig_text.replace("contact_angle_deg = 60.0", 'contact_angle_deg = 60.0\nregime = "blend"')
    assert read(tmp_path, text).tissue.regime == "blend"
    with pytest.raises(ValueError, match=r"\[tissue\] regime must be one of 'low', 'high' or 'blend'; got 'fast'"):
        read(tmp_path, text.replace("blend", "fast"))


def test_reads_a_body_on_a_plate(tmp_path: Path) -> None:
    rig = read(tmp_path, VIBRO_TABLE)
    assert rig.capsule.mass_kg == 0.193
    assert rig.drive is not None
    assert rig.drive.reaction_on_body
    assert rig.surface is not None
    assert rig.surface.friction_coefficient == 0.29


@pytest.mark.parametrize("kind", ["axis", "dma", "periods"])
def test_kind_alone_is_enough(tmp_path: Path, kind: str) -> None:
    assert read(tmp_path, f'[rig]\nkind = "{kind}"').kind == kind


def test_byte_order_mark_is_accepted(tmp_path: Path) -> None:
    assert read(tmp_path, b"\xef\xbb\xbf[rig]\nkind = 'axis'").kind == "axis"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("radius_m = 6.5e-3", "radius_mm = 6.5", r"\[capsule\].*'radius_mm'.*'radius_m'"),
        ("radius_m = 6.5e-3", "radius_m = 6.5", r"\[capsule\] radius_m must be 0.0001 to 0.1 m; got 6.5"),
        ("radius_m = 6.5e-3", "radius_m = '6.5'", r"radius_m must be a finite number"),
        ("radius_m = 6.5e-3", "radius_m = nan", r"radius_m must be a finite number"),
        ("radius_m = 6.5e-3", "radius_m = true", r"radius_m must be a finite number"),
        (
            "mass_kg = 4.0e-3",
            "",
            r"must have the key 'mass_kg' \(1e-05 to 0.5 kg; such as 4.0e-3\); it is",
        ),
        ("magnet_range_m = 0.02", "", r"\[rig\] must have the key 'magnet_range_m'"),
        ("magnet_range_m", "magnet_rnage_m", r"'magnet_rnage_m'; did you mean 'magnet_range_m'"),
        ("[tissue]", "[tisue]", r"'tisue'; did you mean 'tissue'"),
        ("[noise]", "[axis]\n[noise]", r"table \[axis\] must not be there for kind 'magnetic'"),
        ('"magnetic"', '"magnet"', r"'magnet'; did you mean 'magnetic'"),
        ('"magnetic"', '"pull"', r"'magnet_stiffness_N_per_m', which belongs to kind 'magnetic'"),
        ("kind =", "kinds =", r"must have the key 'kind'; got 'kinds'"),
        ('"jejunum"', '"colon"', r"preset must be one of 'jejunum'; got 'colon'"),
        ("60.0", "95.0", r"contact_angle_deg must be 1 to 89 deg; got 95"),
        ("[rig]", "[rig", r"must be TOML"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(tmp_path: Path, rig_text: str, old: str, new: str, said: str) -> None:
    with pytest.raises(ValueError, match=said) as caught:
        read(tmp_path, rig_text.replace(old, new, 1))
    assert "rig.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_plate_needs_its_friction(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="friction_coefficient"):
        read(tmp_path, VIBRO_TABLE.replace("friction_coefficient = 0.29", ""))


def test_gut_needs_capsule_and_tissue(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="radius_m"):
        read(tmp_path, VIBRO_TABLE.replace('"plate"', '"gut"'))


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="No such file"):
        read_rig(tmp_path / "none.toml")
    with pytest.raises(ValueError, match="directory"):
        read_rig(tmp_path)


def test_reference_rigs(shared: Path) -> None:
    for path in sorted((shared / "reference" / "series").glob("*/rig.toml")):
        assert read_rig(path).kind == path.parent.name.split("_")[0]


@given(st.binary(max_size=200))
def test_any_bytes_are_a_rig_or_one_sentence(tmp_path: Path, content: bytes) -> None:
    try:
        read(tmp_path, content)
    except ValueError as error:
        assert "\n" not in str(error)  # noqa: PT017


KEYS = st.sampled_from(
    ["capsule", "tissue", "rig", "noise", "drive", "kind", "mass_kg", "force_N", "velocity_m_s", "x"]
)
LEAVES = st.one_of(
    st.none(), st.booleans(), st.floats(), st.integers(), st.sampled_from(["pull", "vibro", "axis", "periods", "a\nb"])
)
TREES = st.recursive(
    LEAVES,
    lambda inner: st.one_of(st.lists(inner, max_size=2), st.dictionaries(KEYS, inner, max_size=4)),
    max_leaves=12,
)


@given(st.dictionaries(KEYS, TREES, max_size=4))
def test_any_tables_are_a_rig_or_one_sentence(raw: dict[str, object]) -> None:
    try:
        parse_rig(raw)
    except ValueError as error:
        assert "\n" not in str(error)  # noqa: PT017
