"""The catalogue as tables in Markdown: `python -m tests.hil.bus.markdown_tables` prints what docs/bus.md holds."""

from dataclasses import replace

from hil.bus.catalogue import Field, Frame, FrameCatalogue, load_catalogue
from tests.hil.bus.bus_load import bus_load

ONE_DRIVE = ("Controller", "Carriage", "Localiser", "ForceSensor")


def frames_table(catalogue: FrameCatalogue) -> str:
    """Every frame in order of priority: identifier, sender, cycle, load and longest delay with all drives at 500 Hz,
    and its signals.
    """
    shares = {share.id: share for share in bus_load(catalogue)}
    lines = [
        "| id | frame | from | every | load | latest after | signals: range, step |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for frame in sorted(catalogue.frames.values(), key=lambda f: f.id):
        share = shares[frame.id]
        load = f"{100 * share.load:.2f} %" if frame.cycle_s else "-"
        signals = "; ".join(_signal(field) for field in frame.fields)
        times = f"{_cycle(frame)} | {load} | {1e3 * share.delay_s:.2f} ms"
        lines.append(f"| 0x{frame.id:03X} | {frame.name} | {frame.sender} | {times} | {signals} |")
    return "\n".join(lines)


def load_table(catalogue: FrameCatalogue) -> str:
    """What all frames take of the bus, by what is on it."""
    rows = (
        ("all three drives, localisation and force sensor", ()),
        ("carriage, localisation and force sensor", ONE_DRIVE),
        ("carriage and localisation", ONE_DRIVE[:-1]),
    )
    lines = ["| on the bus | load | slowest command | slowest frame of 500 Hz |", "| --- | --- | --- | --- |"]
    for words, nodes in rows:
        shares = bus_load(_between(catalogue, nodes))
        command = max(s.delay_s for s in shares if s.name.endswith("Command"))
        fast = max(s.delay_s for s in shares if s.rate_Hz > 400)
        total = sum(s.load for s in shares)
        lines.append(f"| {words} | {100 * total:.1f} % | {1e3 * command:.2f} ms | {1e3 * fast:.2f} ms |")
    return "\n".join(lines)


def _between(catalogue: FrameCatalogue, nodes: tuple[str, ...]) -> FrameCatalogue:
    """The frames from `nodes` to `nodes`, all where there are none."""
    kept = {n: f for n, f in catalogue.frames.items() if not nodes or (f.sender in nodes and {*nodes} & {*f.receivers})}
    return replace(catalogue, frames=kept)


def _cycle(frame: Frame) -> str:
    return {
        "Cyclic": f"{1e3 * frame.cycle_s:g} ms",
        "Event": "on the event, twice",
        "IfActive": f"{1e3 * frame.cycle_s:g} ms while it holds",
    }[frame.sent]


def _signal(field: Field) -> str:
    if field.names:
        return f"{field.name}: {', '.join(f'{raw} {name}' for raw, name in sorted(field.names.items()))}"
    unit = f" {field.unit}" if field.unit else ""
    return f"{field.name} [{field.lower:g}, {field.upper:g}]{unit}, {field.scale:g}"


if __name__ == "__main__":
    known = load_catalogue()
    print(load_table(known), frames_table(known), sep="\n\n")
