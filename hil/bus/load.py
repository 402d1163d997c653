"""Lengths of frames on the wire in bits, with stuff bits."""

import math
from typing import Any, cast

import numba

_CRC15 = 0x4599  # of classic CAN, ISO 11898-1
_TAIL = 13  # bits after the CRC without stuffing: delimiter, acknowledgement, end of frame, interframe space


def frame_bits(identifier: int, data: bytes | bytearray) -> int:
    """Bits of a classic frame with an 11-bit `identifier`, with stuff bits and the interframe space."""
    return int(_stuffed(identifier << 7 | len(data), int.from_bytes(data, "big", signed=True), 8 * len(data))) + _TAIL


def fd_frame_bits(extended: bool, length: int, ratio: float) -> int:
    """Maximum bits, at the nominal bit rate, of a CAN FD frame of `length` bytes whose data phase is `ratio` faster."""
    head = 36 if extended else 17
    checksum = 17 if length <= 16 else 21
    free = 5 + 8 * length
    fast = free + free // 4 + 4 + checksum + (4 + checksum + 3) // 4
    return head + head // 4 + math.ceil(fast / ratio) + _TAIL


@cast(Any, numba.njit("int64(int64, int64, int64)", cache=True))
def _stuffed(head: int, word: int, size: int) -> int:
    """Bits to the CRC: 19 of `head`, `size` of the data `word`, 15 of the CRC; after five equal ones a stuff bit."""
    rest, run, last, stuff = 0, 0, 1, 0
    before = 19 + size
    for k in range(before + 15):
        if k < 19:
            bit = head >> (18 - k) & 1
        elif k < before:
            bit = word >> (before - 1 - k) & 1
        else:
            bit = rest >> (before + 14 - k) & 1
        if k < before:
            turn = bit ^ (rest >> 14)
            rest = (rest << 1 & 0x7FFF) ^ (_CRC15 if turn else 0)
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuff, run, last = stuff + 1, 1, 1 - bit
    return before + 15 + stuff
