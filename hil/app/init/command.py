"""`capsule init`: a commented rig file, a template record and the command to run, for one's own data to take their
place.
"""

from pathlib import Path
from typing import Final

from hil.app.console import output_to_notes, print_json, summary
from hil.app.init.rig_file import commented, template
from hil.app.write import table_text, write_files
from models.parameter import nearest
from models.rigs.kinds import KINDS

RIG, RECORD, NOTE = "rig.toml", "record.csv", "README.md"
_NOTE: Final = """# A {kind} rig

`rig.toml` says what you believe about the rig; every key stands there with unit, range and meaning.
`record.csv` is a template, **simulated**: it shows the columns ({columns}). Put your records in its place and run

    {command}

Then open `out/report.html`. Further records of the rig go beside the first, records to judge by after `--holdout`.
"""


def init(kind: str, folder: Path, *, rotary: bool = False, json_output: bool = False) -> None:
    """Write `rig.toml`, `record.csv` and `README.md` for a rig of `kind` into `folder`, with `rotary` for an axis that
    turns; what stands there is kept.

    Raises ValueError, one sentence, for an unknown kind, and where one of the files is there already.
    """
    if kind not in KINDS:
        raise ValueError(f"KIND must be one of {', '.join(KINDS)}; got {kind!r}; {nearest(kind, KINDS)}")
    if rotary and KINDS[kind].turning_template is None:
        turning = [name for name, one in KINDS.items() if one.turning_template is not None]
        raise ValueError(f"--rotary must go with KIND {' or '.join(turning)}; got {kind}")
    there = [name for name in (RIG, RECORD, NOTE) if (folder / name).exists()]
    if there:
        names = ", ".join((RIG, RECORD, NOTE))
        raise ValueError(f"DIR must not hold {names} yet, for none is overwritten; got {folder / there[0]}")
    with output_to_notes():
        tables, columns = template(KINDS[kind], rotary=rotary)
    command = f"capsule close-loop {folder / RECORD} --rig {folder / RIG} --out {folder / 'out'}"
    note = _NOTE.format(kind=kind, columns=", ".join(f"`{name}`" for name in columns), command=command)
    files = {RIG: commented(KINDS[kind], tables, list(columns)), RECORD: table_text(columns), NOTE: note}
    write_files({folder / name: text for name, text in files.items()})
    if json_output:
        print_json({"kind": kind, "files": [str(folder / name) for name in files], "command": command})
    else:
        for name, words in (
            (RIG, "what you believe about the rig"),
            (RECORD, "a simulated record: put yours in its place"),
        ):
            summary().print(f"{folder / name}: {words}", markup=False, soft_wrap=True)
        summary().print(f"then: {command}", markup=False, soft_wrap=True)
