"""The report: a page that works offline and stays small, and numbers that any program can read."""

import gzip
import json
import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from plotly.offline import get_plotlyjs_version

from hil.app.console import json_text
from hil.report.builder import PLOTLY
from hil.report.closed_loop import report_html
from hil.report.figure_traces import binned, panels
from hil.report.mathml import equations_html, line_html, math_html
from hil.report.numbers import error_rows, report_json
from hil.report.theme import thinned
from hil.report.words import column_words, error_words, headline, interpolation
from models.effects import CATALOGUE
from models.effects.effect import Effect
from models.effects.equation import equations_of, legend
from models.formula import Formula, called, equal, named, symbols
from models.identification.finding import Check, Disagreement, Finding, Fitted, Profile
from models.words.quantities import amount, change, fixed, number, percent, quantity, scale, unit_words, with_interval
from tests.hil.findings import left_finding, pull_finding, spectrum_finding, table_finding

PLOTLY_BYTES = 700_000


@pytest.fixture(scope="module")
def page() -> str:
    return report_html(pull_finding())


def without_plotly(page: str) -> str:
    return re.sub(r'<script type="application/gzip".*?</script>', "", page, count=1, flags=re.DOTALL)


def test_page_is_self_contained_and_small(page: str) -> None:
    own = without_plotly(page)
    assert len(own) < len(page) - 600_000
    assert "http" not in own.replace("http://www.w3.org", "")
    assert own.count("<link") == own.count('<link rel="icon" href="data:,">') == 1
    assert "src=" not in own
    assert len(page.encode()) < 1_700_000


def test_library_of_the_pages_is_of_the_release_that_makes_the_figures() -> None:
    major = get_plotlyjs_version().split(".")[0]
    assert f"plotly.js (cartesian - minified) v{major}." in gzip.decompress(PLOTLY.read_bytes())[:200].decode()


def test_page_holds_the_whole_story(page: str) -> None:
    for said in (
        "What the model lacked: folds of the gut or a peristaltic wave; these records cannot tell which.",
        "11.3 mN (nominal) to 8.6 mN (calibrated) to 0.91 mN (augmented)",
        "noise floor is 0.75 mN",
        "Resistance varies periodically along the lumen",
        "peristaltic wave",
        "not identifiable",
        "Next experiment",
        "reverse over the same positions",
        "<msub><mi>F</mi><mtext>act</mtext></msub>",
        "1 of 2 checks fail",
        "beyond",
        "calibration",
        "In 200 imitated records",
    ):
        assert said in page
    assert "nan" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)


def test_size_stays_bounded_with_many_long_records() -> None:
    finding = pull_finding(seconds=2.0)
    long = pull_finding(seconds=40.0).traces[0]
    many = Finding(**{**finding.__dict__, "traces": (long,) * 14})
    assert len(report_html(many).encode()) < PLOTLY_BYTES + 1_100_000


@pytest.mark.parametrize(
    "finding", [pull_finding("none", 5.0), pull_finding("unknown", 5.0), table_finding(), spectrum_finding()]
)
def test_every_verdict_and_kind_makes_a_page(finding: Finding) -> None:
    own = without_plotly(report_html(finding))
    assert headline(finding) in own
    if finding.kind == "vibro_table":
        assert "drive period in ms" in own
    if finding.kind == "dma":
        assert "loss modulus" in own


def test_names_cannot_break_out_of_the_page() -> None:
    finding = pull_finding(seconds=2.0)
    bad = "</script><script>alert(1)</script>"
    trace = finding.traces[0]
    evil = Finding(
        **{
            **finding.__dict__,
            "traces": (trace.__class__(**{**trace.__dict__, "name": bad}),),
            "statements": (bad,),
            "equations": ([bad, Formula(bad)],),
            "next_experiment": bad,
        }
    )
    assert "<script>alert" not in report_html(evil)


def test_an_empty_finding_still_makes_a_page() -> None:
    finding = pull_finding("none", 2.0)
    nothing: dict[str, object] = dict.fromkeys(("traces", "checks", "candidates", "statements", "equations"), ())
    nothing |= {"calibration": {}, "timings": {}, "smallest_detectable": {}, "next_experiment": None}
    assert "no missing effect" in report_html(Finding(**{**finding.__dict__, **nothing}))


def test_json_has_the_published_keys_and_no_nan() -> None:
    document = json.loads(
        json_text(report_json(pull_finding(seconds=2.0))), parse_constant=lambda name: pytest.fail(f"{name} in JSON")
    )
    assert document["verdict"] == "named"
    effect = document["effects"][0]
    assert (effect["id"], effect["equivalent"], effect["evidence"]) == ("fold_periodic", ["peristaltic_wave"], 41.2)
    assert effect["parameters"]["wavelength_m"]["ci95"] == [0.0072, 0.0074]
    assert effect["parameters"]["phase_rad"]["ci95"] == [None, None]
    assert set(document["error"]) >= {"quantity", "measure", "train", "holdout", "noise_floor"}
    assert set(document["error"]["holdout"]) == {"nominal", "calibrated", "augmented"}
    assert set(document) >= {
        "next_experiment",
        "smallest_detectable",
        "seconds",
        "calibration",
        "checks",
        "candidates",
        "timings",
        "kind",
    }


def test_json_of_a_finding_without_hold_out_has_nulls() -> None:
    error = report_json(spectrum_finding())["error"]
    assert error["holdout"] == {"nominal": None, "calibrated": None, "augmented": None}
    assert error["unit"] == "%"
    assert error["noise_floor"] is None


def test_thinning_keeps_the_teeth() -> None:
    t = np.linspace(0, 1, 100_000)
    saw = (t * 400) % 1.0
    x, y = thinned(t, saw, 2000)
    assert len(x) <= 2002
    assert np.all(np.diff(x) > 0)
    assert y.max() > 0.99
    assert y.min() < 0.01
    assert np.count_nonzero(np.diff(y) < -0.5) >= 395


def test_local_means() -> None:
    centres, means = binned(np.array([1.0, 1.0, 2.0]), np.array([1.0, 3.0, 5.0]))
    assert centres.tolist() == [1.0, 2.0]
    assert means.tolist() == [2.0, 5.0]


def test_quantities_of_one_record_are_drawn_apart() -> None:
    finding = spectrum_finding()
    drawn = panels(finding, finding.traces[0])
    assert [(p.quantity, p.unit) for p in drawn] == [("storage modulus G′", "Pa"), ("loss modulus G″", "Pa")]
    assert set(drawn[0].predicted) == {"nominal", "calibrated"}


X, Y, V = symbols("x y v")


@pytest.mark.parametrize(
    ("formula", "inside"),
    [
        (Formula("F_act"), "<msub><mi>F</mi><mtext>act</mtext></msub>"),
        (7.3e-05 * X, "<msup><mn>10</mn><mn>−5</mn></msup>"),
        (X / (Y + 1), "<mfrac><mrow><mi>x</mi></mrow><mrow><mi>y</mi><mo>+</mo><mn>1</mn></mrow></mfrac>"),
        (2 * np.pi * X, "<mn>2</mn><mi>π</mi>"),
        (Formula("tau_1") * Formula("v'"), "<msub><mi>τ</mi><mtext>1</mtext></msub>"),
        (Formula("u_cmd'"), '<msub><mi>u</mi><mtext>cmd</mtext></msub><mo lspace="0" rspace="0">′</mo></mrow>'),
        (called("F_e", abs(V)), '<mo stretchy="false">|</mo><mi>v</mi><mo stretchy="false">|</mo></mrow>'),
        (np.sqrt(X), "<msqrt><mi>x</mi></msqrt>"),
        (np.where(X < 0, 1, 2), "<mtext>elsewhere</mtext>"),
        (X <= Y, "<mi>x</mi><mo>≤</mo><mi>y</mi>"),
        (equal(X, named("q", Y + 1)), "<mi>q</mi><mo>=</mo><mi>y</mi>"),
        ((X + 1) ** Y, ">)</mo></mrow></mrow><mrow><mi>y</mi></mrow></msup>"),
        (X - (Y - 1), '<mo stretchy="false">(</mo>'),
        (Formula("a < b & c"), "a &lt; b &amp; c"),
    ],
)
def test_equations(formula: Formula, inside: str) -> None:
    written = math_html(formula)
    assert inside in written.replace('</math> <math displaystyle="true">', "").replace(
        ' form="infix" lspace="0" rspace="0.22em"', ""
    )
    ElementTree.fromstring(f"<p>{written}</p>".replace("&nbsp;", " "))


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=lambda effect: effect.id)
def test_every_effect_is_typeset_well_formed(effect: type[Effect]) -> None:
    page = equations_html([[formula] for formula in equations_of(effect)])
    assert page.count('class="line"') == len(equations_of(effect))
    ElementTree.fromstring(page.replace("&nbsp;", " "))


def test_words_of_a_line_stand_between_its_formulas() -> None:
    assert line_html(["stick <", equal(X, Y)]).startswith("stick &lt;<math ")


def test_the_page_explains_the_symbols_of_its_equations(page: str) -> None:
    assert legend([["w ", Formula("u_w"), equal(Formula("F_act"), Formula("k"))]]) == {
        "F_act": "force of the drive",
        "u_w": "displacement of the wall, m",
    }
    assert "friction scale: factor on <i>F</i><sub>e</sub>" in page


def test_numbers_and_units() -> None:
    assert number(float("nan")) == "–"
    assert number(1.5e-7) == "1.5·10⁻⁷"
    assert number(123456.0, 3) == "123000"
    assert number(-0.0) == "0"
    assert fixed(-1e-5, 2) == "0.00"
    assert quantity(0.0113, "N") == "11.3 mN"
    assert quantity(549400.0, "Pa") == "549 kPa"
    assert quantity(14.2, "%") == "14.2 %"
    assert amount(5.68e-10, "%") == "< 0.01 %"
    assert percent(-1e-9) == "< 0.01 %"
    assert (change(4.278, 1.0), change(1.05, 1.0), change(0.99999, 1.0)) == ("× 4.3", "+5.0 %", "0.0 %")
    assert scale([], "N") == (1.0, "N")
    units = {"N s/m": "N·s/m", "N/m^3": "N/m³", "m/s2": "m/s²", "N at 10 mm/s": "N at 10 mm/s", "log10 Pa": "log10 Pa"}
    assert {unit: unit_words(unit) for unit in units} == units
    assert column_words("v_m_s") == ("speed", "m/s")
    assert column_words("magnet_stiffness_N_per_m") == ("magnet stiffness", "N/m")


def test_digits_come_from_the_interval() -> None:
    words = with_interval(0.0073123, (0.0072, 0.0074))
    assert (words.value, words.low, words.high) == ("0.00731", "0.00720", "0.00740")
    assert with_interval(549412.0, (512345.0, 580000.0)).value == "549000"
    assert with_interval(1.0, (float("nan"), float("nan"))).low == "–"


def test_as_many_numbers_as_means_are_an_interpolation() -> None:
    finding = pull_finding("none", 2.0)
    three = finding.traces[0]
    flat = np.tile([1.0, 2.0, 3.0], (8, 1))
    means = three.__class__(
        "means", "train", "period_index", np.arange(8.0), flat, dict.fromkeys(three.predicted, flat)
    )
    few_means = Finding(**{**finding.__dict__, "traces": (means,), "error": {"train": finding.error["train"]}})
    assert interpolation(few_means).startswith("3 parameters are fitted to 3 means")
    assert "interpolated" in report_html(few_means)
    assert not interpolation(finding)


def test_story_without_hold_out_says_so() -> None:
    assert "none were held out" in error_words(spectrum_finding())


def test_a_held_out_error_by_chance_is_named_as_such() -> None:
    errors = {part: {"nominal": 0.011, "calibrated": 0.009, "augmented": 0.009} for part in ("train", "holdout")}
    check = Check("held_out", "held-out residual", 0.9, 2.0, True, "of the free run")
    finding = replace(pull_finding("none"), error=errors, noise_floor=1e-3, checks=(check,))
    assert error_words(finding).endswith("single slip events may add the rest.")
    assert "uncertain" not in error_words(replace(finding, noise_floor=8e-3))


def test_headlines() -> None:
    assert headline(pull_finding("unknown", 2.0)).startswith("The residual is structured")
    partly = Finding(**{**pull_finding(seconds=2.0).__dict__, "verdict": "unknown"})
    assert headline(partly).endswith(
        "A part looks like folds of the gut or a peristaltic wave: 89 % of the error goes with it."
    )
    assert not Fitted(1.0, (0.0, 2.0), identifiable=False).identifiable


def test_an_unknown_says_first_what_is_left_and_writes_the_term_with_units() -> None:
    finding = left_finding()
    left = "What is left: a 7 mm wave over position, 53 % of the residual."
    assert headline(finding).startswith(left)
    page = report_html(finding)
    sections = [page.index(f'<section id="{key}">') for key in ("depends", "error", "next", "residual")]
    assert sections == sorted(sections)
    assert finding.dependence
    assert finding.dependence.term
    law, numbers = finding.dependence.term.text.split(", ", 1)
    assert law == "F_extra = -sgn(v) (F_0 + F_1 sin(2 pi x/L + phi))"
    assert numbers == "F_0 = 2 mN, F_1 = 3 mN, L = 7 mm, phi = 0.4"
    assert law in page


def test_the_effect_stands_before_the_next_experiment(page: str) -> None:
    assert page.index('<section id="effect">') < page.index('<section id="next">')


def test_a_part_without_records_has_no_noise_floor() -> None:
    finding = replace(pull_finding(seconds=2.0), error={"train": {"nominal": 0.01, "calibrated": 0.008}, "holdout": {}})
    train, held = error_rows(finding)
    assert train[-1] == "0.75 mN"
    assert set(held[1:]) == {"–"}


def test_a_long_equation_may_go_on_in_the_next_line() -> None:
    sum_ = sum((Formula(f"a_{k}") * np.sin(k * X) for k in range(2, 9)), Formula("a_1"))
    page = math_html(equal(Formula("scale"), np.maximum(1 + Formula("d") * sum_, 0.05)))
    assert page.count("<math ") > 7
    ElementTree.fromstring(f"<p>{page}</p>".replace("&nbsp;", " "))
    a, b, c, d = symbols("a b c d")
    assert math_html(equal(Y, (a + b) / (c + d))).count("<math ") == 1


def test_a_record_that_disagrees_is_told_in_a_sentence_and_in_numbers() -> None:
    odd = Disagreement("train_2", "friction_coefficient", 0.0113, (0.0112, 0.0114), "1", 31.4)
    finding = replace(pull_finding(seconds=2.0), disagreeing=(odd,))
    assert "train_2 disagrees with the other records by friction coefficient" in report_html(finding)
    (told,) = report_json(finding)["disagreeing_records"]
    assert told["by"] == "friction_coefficient"
    assert told["ci95"] == [0.0112, 0.0114]
    assert report_json(pull_finding(seconds=2.0))["disagreeing_records"] == []


def test_profiles_are_drawn_and_a_flat_one_says_so() -> None:
    values = tuple(0.01 * k for k in range(1, 10))
    flat = Profile("recovery_time_s", 0.05, "s", values, (0.1,) * 9)
    open_ended = Profile("fold_periodic.depth", 0.05, "1", values, (0, 0, 0.1, 0.2, 0, 1, 3, 6, 9), ("lower",))
    finding = replace(pull_finding(seconds=2.0), profiles=(flat, open_ended))
    page = report_html(finding).replace("\\u003cbr\\u003e", " ").replace("\\u003cbr>", " ")
    assert "recovery time (flat)" in page
    assert "depth, folds of the gut (no lower end)" in page
    assert report_json(finding)["profiles"]["fold_periodic.depth"]["unshown"] == ["lower"]
