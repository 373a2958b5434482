"""What can be read of a damaged LZ4 frame, after the format's description (github.com/lz4/lz4, doc/).

A frame is a header, then blocks with their lengths. A block is a sequence of literals and of copies of what came before
in it or, unless the header says that blocks are independent, in the 64 KiB before it.
"""

import struct

import lz4.block

_MAGIC = b"\x04\x22\x4d\x18"
_HISTORY_BYTES = 1 << 16
_UNCOMPRESSED = 1 << 31
_INDEPENDENT, _BLOCK_CHECKSUM, _CONTENT_SIZE, _DICTIONARY = 0x20, 0x10, 0x08, 0x01


def sound_beginning(frame: bytes, limit: int) -> bytes:
    """The content of `frame`, up to `limit` bytes, before its damage; where blocks are independent, of later ones too.

    The damage is where a block no longer can be decompressed. It often is some bytes before that, so that the last of
    what is returned may be wrong.
    """
    if len(frame) < 7 or not frame.startswith(_MAGIC):
        return b""
    flags, largest = frame[4], 1 << 8 + 2 * (frame[5] >> 4 & 7)
    at = 7 + 8 * bool(flags & _CONTENT_SIZE) + 4 * bool(flags & _DICTIONARY)
    found = bytearray()
    while at + 4 <= len(frame) and len(found) < limit:
        (size,) = struct.unpack_from("<I", frame, at)
        data = frame[at + 4 : at + 4 + (size & ~_UNCOMPRESSED)]
        at += 4 + (size & ~_UNCOMPRESSED) + 4 * bool(flags & _BLOCK_CHECKSUM)
        history = b"" if flags & _INDEPENDENT else bytes(found[-_HISTORY_BYTES:])
        block, whole = (data, True) if size & _UNCOMPRESSED else _block(data, history, largest)
        found += block
        if not data or not (whole or flags & _INDEPENDENT):
            break
    return bytes(found[:limit])


def _block(data: bytes, history: bytes, largest: int) -> tuple[bytes, bool]:
    """The content of a block, or its beginning; and whether it is whole."""
    try:
        return bytes(lz4.block.decompress(data, uncompressed_size=largest, dict=history)), True
    except (lz4.block.LZ4BlockError, MemoryError, ValueError):
        return _beginning_of_block(data, history, largest), False


def _beginning_of_block(data: bytes, history: bytes, largest: int) -> bytes:
    out = bytearray(history)
    at = 0
    while at < len(data) and len(out) - len(history) < largest:
        literals, at_literals = _length(data, at + 1, data[at] >> 4)
        out += data[at_literals : at_literals + literals]
        copied, after = _length(data, at_literals + literals + 2, data[at] & 15)
        distance = int.from_bytes(data[at_literals + literals : at_literals + literals + 2], "little")
        if after > len(data) or not 0 < distance <= len(out):
            break
        start = len(out) - distance
        for k in range(min(copied + 4, largest)):
            out.append(out[start + k])
        at = after
    return bytes(out[len(history) :][:largest])


def _length(data: bytes, at: int, length: int) -> tuple[int, int]:
    """A length whose first four bits are `length`, and where what follows it is."""
    if length < 15:
        return length, at
    while at < len(data):
        length, at = length + data[at], at + 1
        if data[at - 1] != 255:
            break
    return length, at
