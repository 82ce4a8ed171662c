"""CRC and counter of a protected frame (AUTOSAR E2E profiles 1 and 5).

Profile 5: CRC-16/CCITT-FALSE over what follows the CRC, then the DataID, low byte first; CRC in bytes 0 and 1, low
byte first; counter 0..255 in byte 2. Profile 1: CRC-8/SAE-J1850 with start value and final XOR both 0 over DataID
low, DataID high and what follows the CRC; CRC in byte 0; counter 0..14 in the low nibble of byte 1, 15 never used.
Source: AUTOSAR PRS_E2EProtocol (document 849), E2E profiles 1 (both bytes of the DataID) and 5.
"""

from __future__ import annotations

from binascii import crc_hqx
from dataclasses import dataclass
from typing import Final

_POLYNOMIAL_8 = 0x1D


def _crc_8_table() -> bytes:
    """Return the 256 remainders of one byte."""
    table = bytearray()
    for byte in range(256):
        for _ in range(8):
            byte = (byte << 1) ^ (_POLYNOMIAL_8 if byte & 0x80 else 0)
            byte &= 0xFF
        table.append(byte)
    return bytes(table)


_TABLE_8: Final = _crc_8_table()


@dataclass(frozen=True)
class Protection:
    """End-to-end protection of one frame.

    Attributes
    ----------
    profile : 1 or 5, the AUTOSAR E2E profile.
    data_id : 16 bit number known to both ends and not in the frame; it distinguishes frames.
    end : number of bytes that the CRC covers, itself included; None for all.
    """

    profile: int
    data_id: int
    end: int | None = None

    @property
    def counter_modulus(self) -> int:
        """Number of counter values: 15 of profile 1, 256 of profile 5."""
        return 15 if self.profile == 1 else 256

    @property
    def counter_place(self) -> tuple[int, int]:
        """Byte of the counter, and its bits in that byte."""
        return (1, 0x0F) if self.profile == 1 else (2, 0xFF)


def crc_of(data: bytes | bytearray, protection: Protection, covered: bytes = b"") -> int:
    """Return the CRC of ``data`` without its CRC field, followed by ``covered``, bytes of other frames."""
    if protection.profile == 1:
        crc = _TABLE_8[protection.data_id & 0xFF]
        crc = _TABLE_8[crc ^ (protection.data_id >> 8)]
        for byte in data[1 : protection.end] + covered:
            crc = _TABLE_8[crc ^ byte]
        return crc
    crc = crc_hqx(data[2 : protection.end], 0xFFFF)
    if covered:
        crc = crc_hqx(covered, crc)
    return crc_hqx(protection.data_id.to_bytes(2, "little"), crc)


def crc_in(data: bytes | bytearray, protection: Protection) -> int:
    """Return the CRC in ``data``."""
    return data[0] if protection.profile == 1 else data[0] | data[1] << 8


def counter_in(data: bytes | bytearray, protection: Protection) -> int:
    """Return the counter in ``data``."""
    byte, bits = protection.counter_place
    return data[byte] & bits


def protect(data: bytes, protection: Protection, counter: int, covered: bytes = b"") -> bytes:
    """Return ``data`` with counter (modulo its range) and CRC written into it."""
    protected = bytearray(data)
    counter %= protection.counter_modulus
    if protection.profile == 1:
        protected[1] = protected[1] & 0xF0 | counter
        protected[0] = crc_of(protected, protection, covered)
    else:
        protected[2] = counter
        protected[:2] = crc_of(protected, protection, covered).to_bytes(2, "little")
    return bytes(protected)
