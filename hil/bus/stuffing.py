"""How many bits a classic CAN frame really takes: its CRC-15 and its stuff bits, a byte at a time."""

from __future__ import annotations

_CRC15 = 0x4599
_TAIL = 13
"""Bits after the CRC that are never stuffed: delimiter, acknowledgement, end of frame, and the space to the next one."""


def _crc15_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        rest = byte << 7
        for _ in range(8):
            rest = ((rest << 1) ^ _CRC15) & 0x7FFF if rest & 0x4000 else rest << 1
        table.append(rest)
    return tuple(table)


def _stuff_table(width: int) -> tuple[tuple[tuple[int, int], ...], ...]:
    """For each state (last bit, how many alike: 2 n + bit) and the next `width` bits: stuff bits put in, and the state after."""
    return tuple(tuple(_stuffed(state, bits, width) for bits in range(1 << width)) for state in range(12))


def _stuffed(state: int, bits: int, width: int) -> tuple[int, int]:
    run, last = divmod(state, 2)
    count = 0
    for k in reversed(range(width)):
        bit = bits >> k & 1
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            count, run, last = count + 1, 1, 1 - bit
    return count, 2 * run + last


_CRC_TABLE = _crc15_table()
_BY_BYTE = _stuff_table(8)
_BY_BITS = tuple(_stuff_table(width) for width in range(8))
_START = 1  # no bit yet; the start of frame, a 0, begins the first run


def frame_bits(identifier: int, data: bytes | bytearray) -> int:
    """Bits of the frame with an 11-bit `identifier` and up to 8 bytes of `data`, stuff bits and the space after it included."""
    length = len(data)
    head = (identifier << 7 | length) << 8 * length | int.from_bytes(data, "big")
    rest = 0
    for byte in head.to_bytes(11, "big"):
        rest = _CRC_TABLE[(rest >> 7 ^ byte) & 0xFF] ^ (rest << 8 & 0x7FFF)
    total = 34 + 8 * length
    bits = head << 15 | rest
    over, whole = total % 8, total // 8
    stuff, state = _BY_BITS[over][_START][bits >> 8 * whole]
    for byte in (bits & ((1 << 8 * whole) - 1)).to_bytes(whole, "big"):
        more, state = _BY_BYTE[state][byte]
        stuff += more
    return total + stuff + _TAIL
