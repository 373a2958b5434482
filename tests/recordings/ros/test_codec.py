"""The message codec: round trips, agreement with rosbags, and nothing but CodecError on malformed bytes."""

import random

import pytest
from hypothesis import given, settings
from messages import EXAMPLES, MEASUREMENTS, assert_same, sensor_of

from wayfi.backend.errors import WayfiError
from wayfi.frontends.measurements import (
    Measurement,
)
from wayfi.recordings.ros.codec import decode, encode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR, TYPESTORE
from wayfi.recordings.ros.topics import Encoding

RELAXED = settings(deadline=None, max_examples=60)


@RELAXED
@given(MEASUREMENTS)
def test_cdr_round_trip(measurement: Measurement) -> None:
    assert_same(measurement, decode(encode(measurement), sensor_of(measurement), Encoding.CDR))


@RELAXED
@given(MEASUREMENTS)
def test_cdr_of_either_byte_order_is_what_rosbags_reads_and_writes(measurement: Measurement) -> None:
    sensor, data = sensor_of(measurement), encode(measurement)
    message = TYPESTORE.deserialize_cdr(data, TYPE_OF_SENSOR[sensor])
    assert bytes(TYPESTORE.serialize_cdr(message, TYPE_OF_SENSOR[sensor])) == data
    big = bytes(TYPESTORE.serialize_cdr(message, TYPE_OF_SENSOR[sensor], little_endian=False))
    assert_same(measurement, decode(big, sensor, Encoding.CDR))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda e: type(e).__name__)
@pytest.mark.parametrize("encoding", list(Encoding))
def test_every_truncation_is_a_codec_error(example: Measurement, encoding: Encoding) -> None:
    data = encode(example, encoding)
    for size in range(len(data)):
        with pytest.raises(CodecError):
            decode(data[:size], sensor_of(example), encoding)


def mutated(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        kind, at = rng.randrange(4), rng.randrange(len(changed))
        if kind == 0:
            changed[at] = rng.randrange(256)
        elif kind == 1:
            changed[at : at + 4] = rng.choice([b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x10", b"\0\0\0\0"])
        elif kind == 2:
            del changed[at : at + rng.randint(1, 8)]
        else:
            changed[at:at] = rng.randbytes(rng.randint(1, 8))
        changed = changed or bytearray(b"\0")
    return bytes(changed)


@pytest.mark.parametrize("encoding", list(Encoding))
def test_mutated_messages_raise_codec_error_or_decode(encoding: Encoding) -> None:
    rng = random.Random(11)
    originals = [(encode(example, encoding), sensor_of(example)) for example in EXAMPLES]
    refused = 0
    for _ in range(20_000):
        data, sensor = rng.choice(originals)
        try:
            measurement = decode(mutated(data, rng), sensor, encoding)
        except CodecError:
            refused += 1
            continue
        assert isinstance(measurement.stamp_ns, int)
        encode(measurement, Encoding.JSON)
    assert refused > 1_000


def test_codec_error_is_a_wayfi_error() -> None:
    assert issubclass(CodecError, WayfiError)
