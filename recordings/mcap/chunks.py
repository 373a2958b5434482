"""The content of chunks, decompressed; of damaged ones, what comes before the damage."""

import zlib
from dataclasses import dataclass

import lz4.frame
import zstandard

from wayfi.recordings.mcap.lz4_salvage import sound_beginning

LARGEST_CHUNK_BYTES = 1 << 30
LARGEST_SALVAGED_BYTES = 1 << 27
"""Of a chunk that is damaged, whose size may be, too: chunks are of some MiB."""
_FED_AT_ONCE_BYTES = 64
_FAULTS = (zstandard.ZstdError, RuntimeError, MemoryError, OverflowError, ValueError)


@dataclass(frozen=True, slots=True)
class Content:
    """The `data` of a chunk; `damage` says what is wrong with it, and is empty where nothing is."""

    data: bytes
    damage: str = ""


def decompress(data: bytes, compression: str, size: int, checksum: int) -> Content:
    """The `size` bytes that `data` was compressed from, or those before the damage; `checksum` 0: there is none."""
    try:
        content = _decompressed(data, compression, size)
    except _FAULTS as fault:
        return Content(_beginning(data, compression, size), f"{compression}: {str(fault).lower()}")
    if len(content) != size:
        return Content(content, f"{len(content)} bytes where there should be {size}")
    if checksum and zlib.crc32(content) != checksum:
        return Content(content, "a wrong checksum")
    return Content(content)


def _decompressed(data: bytes, compression: str, size: int) -> bytes:
    if size > LARGEST_CHUNK_BYTES:
        raise ValueError(f"a chunk of {size} bytes")
    if compression == "zstd":
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=size) if data else b""
    if compression == "lz4":
        return bytes(lz4.frame.decompress(data)) if data else b""
    if compression == "":
        return data
    raise ValueError(f"unknown compression {compression!r}")


def _beginning(data: bytes, compression: str, size: int) -> bytes:
    limit = min(size, LARGEST_SALVAGED_BYTES)
    if compression == "zstd":
        return _zstd_beginning(data, limit)
    return sound_beginning(data, limit) if compression == "lz4" else b""


def _zstd_beginning(data: bytes, limit: int) -> bytes:
    """What zstandard gives before it finds the damage: its blocks are of 128 KiB."""
    decompressor = zstandard.ZstdDecompressor().decompressobj()
    found = bytearray()
    try:
        for at in range(0, len(data), _FED_AT_ONCE_BYTES):
            found += decompressor.decompress(data[at : at + _FED_AT_ONCE_BYTES])
            if len(found) > limit or decompressor.eof:
                break
    except _FAULTS:
        pass
    return bytes(found[:limit])
