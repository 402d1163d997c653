"""CRC-8 with polynomial 0x2F, as AUTOSAR E2E profile 2 computes it."""

from __future__ import annotations

POLYNOMIAL = 0x2F
_START = _END = 0xFF


def crc_table(polynomial: int) -> bytes:
    """Remainder of every byte: `x^8 b mod (x^8 + polynomial)`."""
    table = bytearray()
    for byte in range(256):
        rest = byte
        for _ in range(8):
            rest = ((rest << 1) ^ polynomial) & 0xFF if rest & 0x80 else rest << 1
        table.append(rest)
    return bytes(table)


_TABLE = crc_table(POLYNOMIAL)


def crc8(data: bytes | bytearray | memoryview, data_id: int) -> int:
    """CRC of `data` followed by the byte `data_id`: start 0xFF, result inverted.

    On a frame of 8 bytes, one of them the CRC itself, it misses no error of one, two or three bits (Hamming distance 4).
    """
    table, rest = _TABLE, _START
    for byte in data:
        rest = table[rest ^ byte]
    return table[rest ^ data_id] ^ _END
