"""Poses in the plane. `T_a_b` is the pose of frame b in frame a, and T_a_b @ T_b_c = T_a_c.

One pose is a `Pose2`; many are an (n, 3) array of x (m), y (m), theta (rad).
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def wrap(angle: float) -> float:
    """`angle` (rad) brought into [-pi, pi)."""
    wrapped = (angle + math.pi) % (2 * math.pi) - math.pi
    return -math.pi if wrapped >= math.pi else wrapped  # just below -pi the remainder rounds up to a whole turn


def wrap_all(angles: Floats) -> Floats:
    """`angles` (rad, any shape) brought into [-pi, pi)."""
    wrapped = (angles + np.pi) % (2 * np.pi) - np.pi
    return np.where(wrapped >= np.pi, -np.pi, wrapped)


class Pose2(NamedTuple):
    """The pose of a child frame in its parent: x, y (m) and theta (rad).

    A tuple is made and pickled three times as fast as a frozen dataclass, and a message makes tens of poses.
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0

    def __matmul__(self, other: "Pose2") -> "Pose2":
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose2(
            self.x + c * other.x - s * other.y, self.y + s * other.x + c * other.y, wrap(self.theta + other.theta)
        )

    def error_of(self, other: "Pose2") -> Floats:
        """(3,) the x, y (m) and theta (rad) that `other`, in the same frame, has over this pose."""
        return np.array([other.x - self.x, other.y - self.y, wrap(other.theta - self.theta)])

    def inverse(self) -> "Pose2":
        """T_b_a of this T_a_b."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose2(-c * self.x - s * self.y, s * self.x - c * self.y, wrap(-self.theta))

    def between(self, other: "Pose2") -> "Pose2":
        """T_a_b of T_m_a (this) and T_m_b (`other`)."""
        return self.inverse() @ other

    def transform(self, points: Floats) -> Floats:
        """(n, 2) points (m) of the child frame, in the parent frame."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        moved: Floats = points @ np.array([[c, s], [-s, c]]) + np.array([self.x, self.y])
        return moved

    def distance(self, other: "Pose2") -> float:
        """Distance (m) between the two origins."""
        return math.hypot(other.x - self.x, other.y - self.y)

    def interpolate(self, other: "Pose2", fraction: float) -> "Pose2":
        """The pose at `fraction` (0 here, 1 at `other`), along the straight line, turning the short way."""
        return Pose2(
            self.x + fraction * (other.x - self.x),
            self.y + fraction * (other.y - self.y),
            wrap(self.theta + fraction * wrap(other.theta - self.theta)),
        )

    def is_finite(self) -> bool:
        """Whether all three numbers are finite."""
        return math.isfinite(self.x) and math.isfinite(self.y) and math.isfinite(self.theta)

    def array(self) -> Floats:
        """(3,) x, y, theta."""
        return np.array([self.x, self.y, self.theta])

    @staticmethod
    def in_plane(T: Floats) -> "Pose2":
        """The x, y and heading of a (4, 4) pose in space."""
        return Pose2(float(T[0, 3]), float(T[1, 3]), math.atan2(T[1, 0], T[0, 0]))

    @staticmethod
    def of(values: Iterable[float]) -> "Pose2":
        """The pose of three numbers x, y, theta."""
        x, y, theta = values
        return Pose2(float(x), float(y), wrap(float(theta)))


def pose_of_common_place(place_a: Floats, place_b: Floats, turned: float) -> Pose2:
    """T_a_b where `place_a` (2,) m in frame a is `place_b` (2,) m in frame b, and b is turned by `turned` (rad)."""
    x, y = place_a - Pose2(0.0, 0.0, turned).transform(place_b[None])[0]
    return Pose2.of((x, y, turned))


def rigid_fit(source: Floats, target: Floats) -> Pose2:
    """The T that maps points `source` (n >= 1, 2) m to `target` (n, 2) with the least squared error."""
    source_mean, target_mean = source.mean(axis=0), target.mean(axis=0)
    s, t = source - source_mean, target - target_mean
    theta = math.atan2(float((s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]).sum()), float((s * t).sum()))
    x, y = target_mean - Pose2(0.0, 0.0, theta).transform(source_mean[None])[0]
    return Pose2.of((x, y, theta))


def diagonal_covariance(sigma_m: float, sigma_rad: float) -> Floats:
    """(3, 3) covariance of a pose whose x, y (m) and theta (rad) err independently."""
    return np.diag([sigma_m**2, sigma_m**2, sigma_rad**2])


def covariance_in_b(covariance: Floats, theta_a_b: float) -> Floats:
    """The (3, 3) covariance or information of a pose in (x, y, theta) of frame a, in those of b, turned by `theta_a_b`.

    gtsam's tangent space of T_a_b has the axes of b.
    """
    c, s = math.cos(theta_a_b), math.sin(theta_a_b)
    R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    turned: Floats = R @ covariance @ R.T
    return turned


def adjoint(T: Pose2) -> Floats:
    """(3, 3) Ad of T_a_b: it takes a small motion expressed in b to the same motion expressed in a."""
    c, s = math.cos(T.theta), math.sin(T.theta)
    return np.array([[c, -s, T.y], [s, c, -T.x], [0.0, 0.0, 1.0]])


def compose_all(a: Floats, b: Floats) -> Floats:
    """(n, 3) poses a[i] @ b[i]; either may be one (3,) pose."""
    a, b = np.broadcast_arrays(np.atleast_2d(a), np.atleast_2d(b))
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    return np.stack(
        [
            a[:, 0] + c * b[:, 0] - s * b[:, 1],
            a[:, 1] + s * b[:, 0] + c * b[:, 1],
            wrap_all(a[:, 2] + b[:, 2]),
        ],
        axis=1,
    )


def between_all(a: Floats, b: Floats) -> Floats:
    """(n, 3) poses inverse(a[i]) @ b[i]; either may be one (3,) pose."""
    a, b = np.broadcast_arrays(np.atleast_2d(a), np.atleast_2d(b))
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    dx, dy = b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]
    return np.stack([c * dx + s * dy, c * dy - s * dx, wrap_all(b[:, 2] - a[:, 2])], axis=1)
