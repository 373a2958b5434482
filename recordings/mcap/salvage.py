"""The records in the content of a block: all of a sound one, and the plausible ones of a damaged one.

Of a damaged block, a message is kept if its channel is known and its log time is within the bounds of its chunk; the
first behind a break only if another such message, or the end, follows it. The message before a break is left out: the
damage may have begun in it.
"""

from collections.abc import Callable, Iterator

from mcap.opcode import Opcode

from wayfi.recordings.mcap.layout import MESSAGE_HEADER, RecordSpan, header_at, record_at

_MESSAGE = bytes([Opcode.MESSAGE])
IsPlausible = Callable[[bytes, RecordSpan], bool]


def records_in(data: bytes) -> Iterator[RecordSpan]:
    """The records of sound `data`. Raises ValueError where it does not consist of records."""
    offset = 0
    while offset < len(data):
        span = header_at(data, offset)
        if span is None or span.end > len(data):
            raise ValueError("it does not consist of records")
        yield span
        offset = span.end


def plausible_records_in(data: bytes, is_plausible: IsPlausible) -> Iterator[RecordSpan]:
    """The records of damaged `data` that may be kept; `is_plausible` judges a message, whose end may be missing."""
    offset = 0
    message: RecordSpan | None = None
    while True:
        span = _plausible_at(data, offset, is_plausible)
        if span is None:
            following = _next_message(data, offset + 1, is_plausible)
            if following is None:
                break
            message, offset = None, following
            continue
        if message is not None:
            yield message
        message = span if span.opcode == Opcode.MESSAGE else None
        if message is None:
            yield span
        offset = span.end
    if message is not None and (offset == len(data) or _is_cut(data, offset, is_plausible)):
        yield message


def _plausible_at(data: bytes, offset: int, is_plausible: IsPlausible) -> RecordSpan | None:
    span = record_at(data, offset)
    if span is None or span.opcode not in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
        return None
    return span if span.opcode != Opcode.MESSAGE or is_plausible(data, span) else None


def _next_message(data: bytes, offset: int, is_plausible: IsPlausible) -> int | None:
    while (offset := data.find(_MESSAGE, offset)) >= 0:
        span = _plausible_at(data, offset, is_plausible)
        if span is not None and _is_followed(data, span.end, is_plausible):
            return offset
        offset += 1
    return None


def _is_followed(data: bytes, end: int, is_plausible: IsPlausible) -> bool:
    return end == len(data) or _plausible_at(data, end, is_plausible) is not None or _is_cut(data, end, is_plausible)


def _is_cut(data: bytes, offset: int, is_plausible: IsPlausible) -> bool:
    """Whether a message begins at `offset`, and `data` ends in it."""
    span = header_at(data, offset)
    if span is None or span.offset + MESSAGE_HEADER.size > len(data):
        return True
    return span.opcode == Opcode.MESSAGE and span.end > len(data) and is_plausible(data, span)
