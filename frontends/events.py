"""What the pipeline estimates and decides, as it happens: frozen values to log, publish or draw.

Arrays in events are never changed after they are handed out.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.health import FailureCategory, State
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.measurements import Sensor


class DropReason(StrEnum):
    """Why a measurement was not used."""

    UNDECODABLE = "undecodable"
    NON_FINITE = "non_finite"
    DUPLICATE = "duplicate"
    STAMP_BACK = "stamp_jumped_back"
    STAMP_AHEAD = "stamp_leapt_ahead"
    NO_RETURN = "no_return"
    NO_READINGS = "no_readings"
    MALFORMED_BSSID = "malformed_bssid"
    ABSURD_RSSI = "absurd_rssi"
    ABSURD_AGE = "absurd_age"
    TOO_MANY_READINGS = "too_many_readings"
    TOO_MANY_RECEIVERS = "too_many_receivers"
    TOO_MANY_WAIT = "too_many_wait"
    CONSTANT_LEVELS = "constant_levels"
    RANDOMISED_BSSIDS = "randomised_bssids"
    CLOCK_OFF = "clock_off"
    NO_POSE = "no_pose"
    NO_TRANSFORM = "no_transform"
    ABSURD_MOUNT = "absurd_mount"
    TOO_MANY_FRAMES = "too_many_frames"
    LOOP_OF_FRAMES = "loop_of_frames"
    RESTLESS_MOUNT = "restless_mount"
    OTHER_SOURCE = "another_source_is_used"
    TOO_LATE = "too_late"
    AHEAD = "ahead_of_odometry"
    IMPLAUSIBLE_MOTION = "implausible_motion"
    INTERNAL_ERROR = "internal_error"
    SENSOR_OFF = "sensor_off"
    OTHER_LASER = "another_laser_is_used"
    IMPOSSIBLE_SCAN = "impossible_scan"
    OTHER_FRAME = "other_frame"
    ABSURD_COVARIANCE = "absurd_covariance"
    NO_MAP = "no_map"
    ADDS_NOTHING = "adds_nothing"


class ClosureKind(StrEnum):
    """The sensor whose pose became the factor; a fix relates a keyframe to the first one, which defines the frame."""

    WIFI = "wifi"
    LIDAR = "lidar"
    FIX = "fix"


class Verdict(StrEnum):
    """What became of a loop candidate."""

    ACCEPTED = "accepted"
    REFUSED = "refused"
    REMOVED = "removed"


@dataclass(frozen=True, slots=True, eq=False)
class PosePublished:
    """The pose as published for one odometry message (one scan, where there is no odometry).

    `T_odom_base` is the raw odometry; `covariance` is (3, 3) in (x, y, theta) of `map`, m and rad.
    """

    stamp_ns: int
    T_map_base: Pose2
    T_map_odom: Pose2
    T_odom_base: Pose2
    covariance: Floats
    state: State


@dataclass(frozen=True, slots=True, eq=False)
class KeyframeAdded:
    """A keyframe entered the graph. `points` (n, 2) float32 m in base_link, empty without a scan.

    `inlier_ratio` is that of its scan matching, NaN where there was none.
    """

    keyframe: int
    stamp_ns: int
    T_map_base: Pose2
    points: NDArray[np.float32]
    inlier_ratio: float


@dataclass(frozen=True, slots=True, eq=False)
class SubmapMatched:
    """One scan match with the local submap: `submap` (n, 2) m in `map`, and the pose of the keyframe after it."""

    stamp_ns: int
    keyframe: int
    submap: Floats
    T_map_base: Pose2
    inlier_ratio: float


@dataclass(frozen=True, slots=True, eq=False)
class FingerprintAdded:
    """A fingerprint was completed: its `similarity` (m,) to the earlier ones `similar_to` (m,).

    The place is `T_keyframe_base` (m, rad) in the frame of `keyframe`.
    """

    fingerprint: int
    stamp_ns: int
    receiver: str
    keyframe: int
    T_keyframe_base: Pose2
    bssids: tuple[str, ...]
    rssi: NDArray[np.float32]
    similar_to: NDArray[np.int64]
    similarity: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class SequenceMatched:
    """The two sequences of a WiFi candidate: (n, 2) m `points_a` and `points_b`, paired row by row.

    They are in `map`, by the estimate at that time.
    """

    stamp_ns: int
    keyframe_a: int
    keyframe_b: int
    points_a: Floats
    points_b: Floats
    residual_m: float


@dataclass(frozen=True, slots=True, eq=False)
class CheckDone:
    """The bounded check of a candidate: `scan` (n, 2) m in base_link of b, `submap` (m, 2) m in base_link of a.

    `T_a_b_guess` is before, `T_a_b` after; `second_peak` is the runner-up's score over the best's.
    """

    stamp_ns: int
    keyframe_a: int
    keyframe_b: int
    scan: Floats
    submap: Floats
    T_a_b_guess: Pose2
    T_a_b: Pose2
    inlier_ratio: float
    second_peak: float


@dataclass(frozen=True, slots=True, eq=False)
class ClosureJudged:
    """The verdict on a loop candidate between keyframes a (earlier) and b; one row of closures.csv.

    `covariance` is (3, 3) of T_a_b in (x, y, theta) of a, m and rad; without `heading_claimed`, theta is not claimed.
    `closure` numbers candidates from 0; a REMOVED verdict repeats the number of the ACCEPTED one that it replaces.
    """

    closure: int
    stamp_a_ns: int
    stamp_b_ns: int
    keyframe_a: int
    keyframe_b: int
    kind: ClosureKind
    proposed_by: str
    similarity: float
    residual_m: float
    inlier_ratio: float
    T_a_b: Pose2
    covariance: Floats
    heading_claimed: bool
    verdict: Verdict
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class GraphUpdated:
    """After an update: `poses` (n, 3) of all keyframes in `map`, or None where only the newest was added."""

    stamp_ns: int
    keyframe: int
    poses: Floats | None
    factors_added: int
    factors_removed: int
    factors: int
    residual: float


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationUpdated:
    """The wheels' calibration: (4,) scale of distance, scale of turning, bias rad/m, bias rad/s, and their sigmas."""

    stamp_ns: int
    values: Floats
    sigmas: Floats


@dataclass(frozen=True, slots=True)
class StateChanged:
    """The new state, why, and the kind of failure that it is."""

    stamp_ns: int
    state: State
    reason: str
    failure_category: FailureCategory = FailureCategory.NONE


@dataclass(frozen=True, slots=True)
class FloorChanged:
    """The robot is on another floor; None where it is not known on which. A drive begins on floor 0."""

    stamp_ns: int
    floor: int | None


@dataclass(frozen=True, slots=True, eq=False)
class HypothesesFollowed:
    """Where the robot may be in a known map: `T_map_base` (n, 3), the claimed one first, and `evidence` (n,) in nats.

    None of them is claimed unless `claimed`. `points` (m, 2) float32 m in base_link are the newest scan.
    """

    stamp_ns: int
    T_map_base: Floats
    evidence: Floats
    claimed: bool
    points: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Dropped:
    """A measurement, or a reading of a WiFi scan, that was not used; `topic` is a scan's own, empty where unknown."""

    sensor: Sensor
    stamp_ns: int
    reason: DropReason
    topic: str = ""


@dataclass(frozen=True, slots=True)
class Warned:
    """A warning for the report and the log.

    A `complaint` (`receiver.fault`) lasts, and stands in the status, until a warning of the same name `ends` it.
    """

    stamp_ns: int
    text: str
    complaint: str = ""
    ends: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class GridRedrawn:
    """The occupancy grid of a floor.

    `occupancy` (rows, columns) is float32 in [0, 1], 0.5 unknown, row 0 at `origin` (m in map).
    """

    stamp_ns: int
    occupancy: NDArray[np.float32]
    resolution_m: float
    origin_xy_m: tuple[float, float]
    floor: int = 0


Event = (
    PosePublished
    | KeyframeAdded
    | SubmapMatched
    | FingerprintAdded
    | SequenceMatched
    | CheckDone
    | ClosureJudged
    | GraphUpdated
    | CalibrationUpdated
    | StateChanged
    | FloorChanged
    | HypothesesFollowed
    | Dropped
    | Warned
    | GridRedrawn
)
