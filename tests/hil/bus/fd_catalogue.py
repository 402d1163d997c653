"""The catalogue as it goes over an authenticated CAN FD bus, for tools: `python -m tests.hil.bus.fd_catalogue` writes
`capsule_fd.dbc` from `capsule.dbc` anew.
"""

import re
from typing import Final

from hil.bus.authenticated import LENGTH, PAYLOAD
from hil.bus.catalogue import DBC

FD_DBC: Final = DBC.with_name("capsule_fd.dbc")
_FD: Final = 14
"""Number of "StandardCAN_FD" among the frame formats."""
_FORMATS: Final = ",".join(
    [
        '"StandardCAN"',
        '"ExtendedCAN"',
        *(f'"reserved{n}"' for n in range(2, _FD)),
        '"StandardCAN_FD"',
        '"ExtendedCAN_FD"',
    ]
)
_ADDED: Final = (  # signals behind a frame's own: start and length in bits, meaning
    ("Count", 8 * PAYLOAD, 32, "Frames that the sender has sent since its start"),
    ("Epoch", 8 * PAYLOAD + 32, 32, "Number of the sender's start, greater than all before"),
    ("Authenticator", 8 * PAYLOAD + 64, 64, "AES-CMAC of identifier (2 bytes, least first) and bytes 0 to 15, 8 bytes"),
)


def fd_dbc(text: str) -> str:
    """The DBC `text` with every frame in CAN FD: its signals as they are, then count, epoch and authenticator."""
    blocks = re.split(r"\n(?=BO_ )", text)
    numbers = re.findall(r"^BO_ (\d+) ", text, re.M)
    framed = "\n".join(_framed(block) for block in blocks)
    comments = [f'CM_ SG_ {n} {name} "{words}";' for n in numbers for name, _, _, words in _ADDED]
    formats = [f'BA_ "VFrameFormat" BO_ {n} {_FD};' for n in numbers]
    framed = framed.replace("\n\nBA_DEF_ ", "\n" + "\n".join(comments) + "\n\nBA_DEF_ ", 1)
    framed = framed.replace(
        'BA_DEF_ BO_ "DataId"', f'BA_DEF_ BO_ "VFrameFormat" ENUM {_FORMATS};\nBA_DEF_ BO_ "DataId"', 1
    )
    framed = framed.replace(
        'BA_DEF_DEF_ "DataId"', 'BA_DEF_DEF_ "VFrameFormat" "StandardCAN_FD";\nBA_DEF_DEF_ "DataId"', 1
    )
    return framed.replace("\n\nVAL_ ", "\n" + "\n".join(formats) + "\n\nVAL_ ", 1)


def _framed(block: str) -> str:
    """One frame's lines, 24 bytes long and with the added signals after its own."""
    if not block.startswith("BO_ "):
        return block
    lines = block.split("\n")
    last = max(k for k, line in enumerate(lines) if line.startswith(" SG_ "))
    receivers = lines[last].rpartition('" ')[2]
    added = [
        f' SG_ {name} : {start}|{length}@1+ (1,0) [0|{(1 << length) - 1}] "" {receivers}'
        for name, start, length, _ in _ADDED
    ]
    head = re.sub(r": \d+ ", f": {LENGTH} ", lines[0], count=1)
    return "\n".join([head, *lines[1 : last + 1], *added, *lines[last + 1 :]])


if __name__ == "__main__":
    FD_DBC.write_text(fd_dbc(DBC.read_text(encoding="utf-8")), encoding="utf-8", newline="")
