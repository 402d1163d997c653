"""Numbers that were chosen say what they are: at their constant, or in the `settings.toml` of their room."""

import ast
import re
from collections.abc import Iterator

import pytest

from models.files.toml import beside
from tests.places import ROOT

ROOMS = ("controller", "models", "plant", "hil")
MOST = 80
"""Constants without an explanation: those that a reader of the field knows."""
SETTINGS = {
    room: beside(str(ROOT / room / "settings.py"), "settings.toml")
    for room in ("models/checks", "models/identification")
}


def _is_number(node: ast.expr) -> bool:
    match node:
        case ast.Constant(value=value):
            return isinstance(value, int | float) and not isinstance(value, bool)
        case ast.UnaryOp(operand=operand):
            return _is_number(operand)
        case ast.Tuple(elts=elts) | ast.List(elts=elts) | ast.Dict(values=elts) | ast.Call(args=elts):
            return any(map(_is_number, elts))
        case ast.BinOp(left=left, right=right):
            return _is_number(left) or _is_number(right)
    return False


def unexplained(source: str) -> Iterator[str]:
    """Constants of a module that hold a number and have no docstring, no comment beside and none above."""
    lines, body = source.splitlines(), ast.parse(source).body
    for statement, after in zip(body, [*body[1:], None], strict=True):
        match statement:
            case ast.Assign(targets=[target], value=value) | ast.AnnAssign(target=target, value=ast.expr() as value):
                pass
            case _:
                continue
        documented = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        own = lines[statement.lineno - 1 : statement.end_lineno]
        above = lines[statement.lineno - 2].startswith("#")
        called = isinstance(value, ast.Call) and ast.unparse(value.func) not in (
            "MappingProxyType",
            "dict",
            "frozenset",
        )
        if _is_number(value) and not (called or documented or above or any("#" in line for line in own)):
            yield ast.unparse(target)


def test_constants_say_what_they_are() -> None:
    files = [path for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))]
    found = [f"{path.relative_to(ROOT)}: {name}" for path in files for name in unexplained(path.read_text("utf-8"))]
    assert len(found) <= MOST, "\n".join(found)


def test_an_unexplained_constant_is_found() -> None:
    source = 'A = 1\nB: int = -2\nC = (3, "x")\n"""Said."""\nD = {"a": 4.0}\nE = 5  # said\n# said\nF = 6\nG = "text"\n'
    assert list(unexplained(source)) == ["A", "B", "D"]


@pytest.mark.parametrize("room", SETTINGS)
def test_every_setting_is_explained_and_read(room: str) -> None:
    text = "".join(path.read_text("utf-8") for path in sorted((ROOT / "models").rglob("*.py")))
    read = set(re.findall(r"\b(?:SET|CHECKS)\.(\w+)", text))
    for name, (_, *said) in SETTINGS[room].items():
        assert len(said) in (2, 3), name
        assert all(said), name
        assert name in read, name


def test_every_setting_that_is_read_is_stated() -> None:
    for path in sorted((ROOT / "models").rglob("*.py")):
        text = path.read_text("utf-8")
        for room, name in re.findall(r"from models\.(\w+)\.settings import SET(?: as (\w+))?", text):
            read = set(re.findall(rf"\b{name or 'SET'}\.(\w+)", text))
            assert read <= SETTINGS[f"models/{room}"].keys(), path


PLAIN = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
"""Numbers in a comparison that are no threshold; nor is one below 1e-6, which stands for rounding."""


def _compared(source: str) -> Iterator[float]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Compare):
            values = [n.value for n in ast.walk(node) if isinstance(n, ast.Constant)]
            yield from (v for v in values if isinstance(v, float) and v not in PLAIN and v >= 1e-6)


@pytest.mark.parametrize("room", SETTINGS)
def test_no_threshold_hides_in_a_comparison(room: str) -> None:
    files = sorted((ROOT / room).rglob("*.py"))
    found = [f"{path.relative_to(ROOT)}: {v:g}" for path in files for v in _compared(path.read_text("utf-8"))]
    assert len(found) <= 5, "\n".join(found)
