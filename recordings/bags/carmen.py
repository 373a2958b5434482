"""CARMEN logs (.log, .clf): one message a line, as most laser data sets from before ROS come.

A line is `NAME fields... ipc_timestamp host logger_timestamp`. Messages are stamped with the first time, which is the
robot's, and logged at the second. ODOM becomes `/odom`; where there are no such lines, the odometry in those of lasers
does. FLASER and ROBOTLASER1 become `/scan`, RLASER and ROBOTLASER2 `/rear_scan`, their places `/tf_static`.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import (
    SECOND_NS,
    LaserScan,
    Measurement,
    Odometry,
    StaticTransforms,
    Transform,
)
from wayfi.recordings.bags.bag_part import BagPart
from wayfi.recordings.mcap.blocks import Block, Record, RecordingError
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.messages import LASER_SCAN, ODOMETRY, TF_MESSAGE
from wayfi.recordings.ros.topics import Channel, Encoding

ODOM = Channel("/odom", ODOMETRY, Encoding.CDR)
MOUNTS = Channel("/tf_static", TF_MESSAGE, Encoding.CDR)
_LINES_OF_A_BLOCK = 1000
_LONGEST_LINE_BYTES = 1 << 20
_RANGE_MIN_M, _RANGE_MAX_M = 0.02, 80.0  # a SICK's, which reports 81.83 m and more for no return
_LATEST_NS = 2**31 * SECOND_NS  # that a ROS time can hold
_AGREEMENT_M = 0.02  # of a laser's places on the robot: text has centimetres or better


@dataclass(frozen=True, slots=True)
class Laser:
    """What a laser's messages become: their channel, the name of its frame, and the parameter of its place."""

    channel: Channel
    frame_id: str
    parameter: str
    backwards: bool


FRONT = Laser(Channel("/scan", LASER_SCAN, Encoding.CDR), "laser", "robot_frontlaser_offset", False)
REAR = Laser(Channel("/rear_scan", LASER_SCAN, Encoding.CDR), "rear_laser", "robot_rearlaser_offset", True)
LASERS = {b"FLASER": FRONT, b"ROBOTLASER1": FRONT, b"RLASER": REAR, b"ROBOTLASER2": REAR}
NAMES = {*LASERS, b"ODOM", b"PARAM", b"SYNC", b"TRUEPOS"}


@dataclass(frozen=True, slots=True)
class Line:
    """A line that ends with two times: its fields, the robot's time and the logger's."""

    name: bytes
    fields: list[bytes]
    stamp_ns: int
    log_time_ns: int


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """A laser's line: the scan, the robot's pose in it, and the laser's where it is said."""

    scan: LaserScan
    robot: Pose2
    laser: Pose2


class CarmenLog(BagPart):
    """The messages of the log at `path`, in blocks of consecutive lines.

    Raises RecordingError if the file cannot be read.
    """

    profile = "carmen"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._unread = self._raw = 0
        self._has_odometry = False
        self._parameters: dict[str, float] = {}
        self._offsets: dict[Laser, list[Pose2]] = {}
        try:
            self._read_once()
        except OSError as error:
            raise RecordingError(f"cannot read {path}: {error.strerror or error}") from error

    @property
    def warning(self) -> str | None:
        """How many lines could not be read, in one line."""
        if self._raw and not self._offsets:
            return f"{self.path.name}: its {self._raw} RAWLASER1 lines are not read; log FLASER or ROBOTLASER1 as well"
        if not self._unread:
            return None
        return f"{self.path.name} is damaged: {self._unread} lines cannot be read; used the others"

    def records(self, block: Block) -> list[Record]:
        """The messages of `block` in the order of the lines; before the first, where the lasers are."""
        with self.path.open("rb") as file:
            file.seek(block.offset)
            lines = file.read(block.length).split(b"\n")
        first = block.offset == self.blocks[0].offset
        records = [self._mounts(block.start_ns)] if first and self._offsets else []
        for text in lines:
            records += self._records(text)
        return records

    def _read_once(self) -> None:
        """Find the blocks, and what the first messages depend on: the lasers' places, and whether there is odometry."""
        offset = start = 0
        times_ns: list[int] = []
        count = 0
        with self.path.open("rb") as file:
            while text := file.readline(_LONGEST_LINE_BYTES):
                offset += len(text)
                count += 1
                times_ns += self._look_at(text)
                if count % _LINES_OF_A_BLOCK == 0:
                    start = self._end_block(start, offset, times_ns)
                    times_ns = []
        self._end_block(start, offset, times_ns)
        if not self._has_odometry:
            self.counts[ODOM] = sum(self.counts[laser.channel] for laser in self._offsets)
        if self._offsets:
            self.counts[MOUNTS] = 1

    def _end_block(self, start: int, offset: int, times_ns: list[int]) -> int:
        if times_ns:
            self.blocks.append(Block(start, offset - start, min(times_ns), max(times_ns)))
        return offset

    def _look_at(self, text: bytes) -> list[int]:
        """Count a line and learn from it; its log time if it is a message."""
        if text.startswith(b"PARAM "):
            self._learn(text.split())
            return []
        self._raw += text.startswith(b"RAWLASER1 ")
        line = line_of(text)
        if line is None:
            self._unread += text.split(b" ", 1)[0] in NAMES
            return []
        try:
            if line.name == b"ODOM":
                odometry_of(line)
                self._has_odometry = True
                self.counts[ODOM] += 1
            elif line.name in LASERS:
                sweep = sweep_of(line)
                self._offsets.setdefault(LASERS[line.name], []).append(sweep.robot.inverse() @ sweep.laser)
                self.counts[LASERS[line.name].channel] += 1
            else:
                return []
        except (ValueError, IndexError, OverflowError):
            self._unread += 1
            return []
        return [line.log_time_ns]

    def _learn(self, words: list[bytes]) -> None:
        try:
            self._parameters[words[1].decode()] = float(words[2])
        except (ValueError, IndexError):
            return  # a word is no offset

    def _records(self, text: bytes) -> list[Record]:
        line = line_of(text)
        if line is None:
            return []
        try:
            if line.name == b"ODOM":
                return [_record(ODOM, line, odometry_of(line))]
            if line.name not in LASERS:
                return []
            sweep = sweep_of(line)
            scan = [_record(LASERS[line.name].channel, line, sweep.scan)]
            robot = [] if self._has_odometry else [_record(ODOM, line, Odometry(line.stamp_ns, sweep.robot))]
            return robot + scan
        except (ValueError, IndexError, OverflowError, CodecError):
            return []

    def _mounts(self, log_time_ns: int) -> Record:
        transforms = tuple(_transform(laser.frame_id, self._place(laser)) for laser in self._offsets)
        data = encode(StaticTransforms(log_time_ns, transforms))
        return Record(*MOUNTS, log_time_ns, data)

    def _place(self, laser: Laser) -> Pose2:
        """The laser on the robot as all lines agree or, where they do not, as the parameter says; else in the middle.

        In logs whose poses were corrected afterwards, the laser's pose is corrected and the robot's is not.
        """
        turn = math.pi if laser.backwards else 0.0
        offsets = np.array([[offset.x, offset.y] for offset in self._offsets[laser]])
        middle = np.median(offsets, axis=0)
        if middle.any() and np.abs(offsets - middle).max() <= _AGREEMENT_M:
            return Pose2(float(middle[0]), float(middle[1]), turn)
        return Pose2(self._parameters.get(laser.parameter, 0.0), 0.0, turn)


def is_carmen(beginning: bytes) -> bool:
    """Whether a file that begins like this is a CARMEN log: text with a line that has the name of a message."""
    return b"\0" not in beginning and any(line.split(b" ", 1)[0] in NAMES for line in beginning.split(b"\n"))


def line_of(text: bytes) -> Line | None:
    """The parts of a line; None if it is a comment, empty, or does not end with its times."""
    words = text.split()
    if len(words) < 5 or words[0] not in NAMES:
        return None
    try:
        stamp_s, log_time_s = float(words[-3]), float(words[-1])
        stamp_ns, log_time_ns = round(stamp_s * SECOND_NS), round(log_time_s * SECOND_NS)
    except (ValueError, OverflowError):
        return None
    if not 0 <= log_time_ns < _LATEST_NS or stamp_ns >= _LATEST_NS:
        return None
    return Line(words[0], words[1:-3], stamp_ns if stamp_ns > 0 else log_time_ns, log_time_ns)


def odometry_of(line: Line) -> Odometry:
    """The odometry of an ODOM line. Raises ValueError or IndexError if it is broken."""
    return Odometry(line.stamp_ns, _pose(line.fields, 0))


def sweep_of(line: Line) -> Sweep:
    """The scan of a laser's line. Raises ValueError, IndexError or OverflowError if it is broken."""
    return _robot_laser(line) if line.name.startswith(b"ROBOT") else _plain_laser(line)


def _plain_laser(line: Line) -> Sweep:
    """`num_readings [range_readings] x y theta odom_x odom_y odom_theta`, half a turn as a SICK sees it."""
    count = int(line.fields[0])
    ranges = np.array(line.fields[1 : count + 1], dtype=np.float32)
    if count < 2 or len(line.fields) < count + 7:
        raise ValueError("too few readings")
    increment = math.pi / (count - count % 2)  # 180 and 181 beams are a degree apart, 360 and 361 half of it
    scan = _scan(line, ranges, -math.pi / 2, increment, _RANGE_MAX_M)
    return Sweep(scan, _pose(line.fields, count + 4), _pose(line.fields, count + 1))


def _robot_laser(line: Line) -> Sweep:
    """`type start_angle field_of_view resolution max_range accuracy remission_mode num_readings [ranges]

    num_remissions [remissions] laser_x y theta robot_x y theta ...`
    """
    start, _, increment, range_max_m = map(float, line.fields[1:5])
    count = int(line.fields[7])
    ranges = np.array(line.fields[8 : 8 + count], dtype=np.float32)
    remissions = int(line.fields[8 + count])
    poses = 9 + count + remissions
    if count < 2 or remissions < 0 or len(line.fields) < poses + 6:
        raise ValueError("too few readings")
    scan = _scan(line, ranges, start, increment, range_max_m)
    return Sweep(scan, _pose(line.fields, poses + 3), _pose(line.fields, poses))


def _scan(line: Line, ranges: np.ndarray, start: float, increment: float, range_max_m: float) -> LaserScan:
    frame_id = LASERS[line.name].frame_id
    return LaserScan(line.stamp_ns, frame_id, ranges, start, increment, _RANGE_MIN_M, range_max_m)


def _pose(fields: list[bytes], at: int) -> Pose2:
    x, y, theta = map(float, fields[at : at + 3])
    if not all(map(math.isfinite, (x, y, theta))):
        raise ValueError("a pose that is not finite")
    return Pose2(x, y, theta)


def _record(channel: Channel, line: Line, measurement: Measurement) -> Record:
    return Record(*channel, line.log_time_ns, encode(measurement))


def _transform(frame_id: str, place: Pose2) -> Transform:
    half = place.theta / 2
    return Transform("base_link", frame_id, (place.x, place.y, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)))
