"""What no sound sensor sends: messages of every type, mutated where their structure is, in CDR and JSON.

Everything follows from a seed. A mutation is of the fields of a message before it is encoded, or of the bytes after.
"""

import copy
import json
import random
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.ros.json_codec import json_of_message
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR, TYPESTORE
from wayfi.recordings.ros.topics import Encoding

FLOATS = (
    *(0.0, -0.0, float("nan"), float("inf"), -float("inf"), 5e-324, 1e-45, 1e-300, 1e-7, 0.5, -1.0, 3.2, -57.3),
    *(1e6, -1e9, 1e38, -3.4e38, 1e154, -1e300, 1.7e308, -1.7e308),
)
LENGTHS = (0, 1, 0x7F, 0xFFFF, 0x10000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFF0, 0xFFFFFFFF)
TEXTS = ("", "\0", "base_link", "laser", "phone_a", "\n", "é" * 40, "x" * 300, "a" * 5000, "\U0010ffff", "%s{}\\")
JUNK: tuple[Any, ...] = (
    *(None, True, False, "", "text", "NaN", [], {}, [[]], [None], [1, "a"], {"a": 1}, -1, 2**31, 2**63, 2**64, 10**400),
    *(1e308, -1e-320, float("nan"), float("inf"), "\ud800", "A" * 3000, [0] * 3000, "====", 1.5),
)
LONGEST_ARRAY = 3000
TIMES = (2, 2, 2, 3, 3, 3, 3, LONGEST_ARRAY)


class Mutator:
    """Mutates messages; the same seed and the same calls give the same bytes."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._new_names = 0
        self._byte_faults = (self._flip, self._cut, self._extend, self._lengthen, self._other_order, self._splice)

    def message(self, sensor: Sensor, cdr: bytes, encoding: Encoding) -> bytes:
        """A mutation of a sound message of `sensor`, given in `cdr`; sometimes of a sound one with a stamp moved on."""
        how = self._random.random()
        if encoding is Encoding.JSON:
            return self._json(sensor, cdr, how)
        data = cdr if how < 0.4 else self._of_fields(sensor, cdr)
        return self._bytes(data) if how < 0.5 else data

    def _of_fields(self, sensor: Sensor, cdr: bytes) -> bytes:
        message = self._fields(sensor, cdr)
        little = self._random.random() < 0.7
        try:
            return bytes(TYPESTORE.serialize_cdr(message, TYPE_OF_SENSOR[sensor], little_endian=little))
        except (UnicodeEncodeError, struct.error):
            return cdr

    def _fields(self, sensor: Sensor, cdr: bytes) -> Any:  # noqa: ANN401 - a class the typestore generates
        message = TYPESTORE.deserialize_cdr(cdr, TYPE_OF_SENSOR[sensor])
        for _ in range(self._random.choice((1, 1, 2, 5))):
            self._field(message, TYPE_OF_SENSOR[sensor])
        return message

    def _field(self, message: Any, type_name: str) -> None:  # noqa: ANN401
        """Change one field of a message, or of one somewhere in it."""
        name, (node, detail) = self._random.choice(TYPESTORE.fielddefs[type_name][1])
        value = getattr(message, name)
        if node == Nodetype.NAME:
            self._field(value, detail)
        elif node == Nodetype.BASE:
            setattr(message, name, self._base(value, detail[0]))
        elif detail[0][0] == Nodetype.NAME:
            setattr(message, name, self._messages(value, detail[0][1]))
        else:
            setattr(message, name, self._array(value, node == Nodetype.ARRAY))

    def _base(self, value: Any, base: str) -> Any:  # noqa: ANN401
        if base == "string":
            return self._text(value)
        if base.startswith("float"):
            number = self._random.choice((*FLOATS, value * 1.01, value + self._random.gauss(0.0, 0.3)))
            return float(np.clip(number, -3.4e38, 3.4e38)) if base == "float32" else number
        if base == "bool":
            return not value
        limits = np.iinfo(base)
        near = value + self._random.choice((-1, 1, 2, 60, 1000))
        number = self._random.choice((limits.min, limits.max, 0, 1, 100, near, near, near))
        return min(max(number, limits.min), limits.max)

    def _text(self, value: str) -> str:
        """A name that was never heard before, as often as a strange one."""
        if self._random.random() < 0.3:
            return self._random.choice((*TEXTS, value[:-1], value.upper()))
        self._new_names += 1
        n = self._new_names
        return self._random.choice((f"name_{n}", ":".join(f"{b:02x}" for b in n.to_bytes(6, "big")), value + str(n)))

    def _messages(self, values: list[Any], type_name: str) -> list[Any]:
        how = self._random.random()
        if not values or how < 0.1:
            return []
        if how < 0.3:
            return (values * self._random.choice(TIMES))[:LONGEST_ARRAY]
        for value in self._random.sample(values, min(len(values), 4)):
            self._field(value, type_name)
        return values

    def _array(self, values: Any, fixed: bool) -> Any:  # noqa: ANN401 - a numpy array
        values = np.array(values)
        how = self._random.random()
        if how < 0.3 and not fixed:
            return values[: self._random.randrange(len(values) + 1)]
        if how < 0.4 and not fixed:
            return np.resize(values, self._random.choice((1, 2, 50, 300, LONGEST_ARRAY))) if len(values) else values
        if how < 0.5:
            return values[::-1].copy()
        with np.errstate(all="ignore"):
            odd = np.array(self._random.choice(FLOATS if values.dtype.kind == "f" else (0, 1, 255)))
            values[self._random.randrange(4) :: self._random.choice((1, 2, 7, 50))] = odd.astype(values.dtype)
        return values

    def _json(self, sensor: Sensor, cdr: bytes, how: float) -> bytes:
        message = self._fields(sensor, cdr) if how < 0.4 else TYPESTORE.deserialize_cdr(cdr, TYPE_OF_SENSOR[sensor])
        tree = json.loads(json_of_message(message, TYPE_OF_SENSOR[sensor]))
        if how > 0.3:
            for _ in range(self._random.choice((1, 1, 3))):
                self._branch(tree)
        text = json.dumps(tree)
        if how > 0.9:
            text = self._spoilt_text(text)
        data = text.encode(self._random.choice(("utf-8",) * 9 + ("utf-16",)), "surrogatepass")
        return self._bytes(data) if 0.25 < how < 0.35 else data

    def _branch(self, tree: Any) -> None:  # noqa: ANN401 - what JSON holds
        """Replace, leave out or add something in a JSON object or list, or somewhere in it."""
        keys = list(tree) if isinstance(tree, dict) else list(range(len(tree)))
        if not keys:
            return
        key = self._random.choice(keys)
        if isinstance(tree[key], dict | list) and tree[key] and self._random.random() < 0.8:
            self._branch(tree[key])
        elif self._random.random() < 0.2:
            del tree[key]
        else:
            tree[key] = copy.deepcopy(self._random.choice(JUNK))

    def _spoilt_text(self, text: str) -> str:
        depth = self._random.choice((10, 900, 20_000))
        at = self._random.randrange(len(text))
        return self._random.choice(
            (
                "[" * depth + "]" * depth,
                '{"header":' * depth,
                text[:at] + "9" * depth + text[at:],
                text.replace(":", ": NaN, ", 1),
                text[:-1] + "," + text[1:],  # every key twice
                text.replace("0", "1e99999"),
                text.replace('"', "'"),
            )
        )

    def _bytes(self, data: bytes) -> bytes:
        for _ in range(self._random.choice((1, 1, 1, 2, 8))):
            fault: Callable[[bytes], bytes] = self._random.choice(self._byte_faults)
            data = fault(data) if len(data) > 8 else data + b"\0" * 8
        return data

    def _flip(self, data: bytes) -> bytes:
        out = bytearray(data)
        for _ in range(self._random.choice((1, 3, 40))):
            out[self._random.randrange(len(out))] ^= 1 << self._random.randrange(8)
        return bytes(out)

    def _cut(self, data: bytes) -> bytes:
        return data[: self._random.randrange(len(data))]

    def _extend(self, data: bytes) -> bytes:
        return data + self._random.randbytes(self._random.choice((1, 4, 300)))

    def _lengthen(self, data: bytes) -> bytes:
        """Another number where a length may stand: the first 64 bytes have most of them."""
        at = 4 * self._random.randrange(min(len(data), self._random.choice((64, len(data)))) // 4)
        return data[:at] + struct.pack("<I", self._random.choice(LENGTHS)) + data[at + 4 :]

    def _other_order(self, data: bytes) -> bytes:
        return bytes([self._random.choice((0, 0, 1, 255)), self._random.choice((0, 1, 2, 3))]) + data[2:]

    def _splice(self, data: bytes) -> bytes:
        a, b = self._random.randrange(len(data)), self._random.randrange(len(data))
        return data[:a] + data[b:]
