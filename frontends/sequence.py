"""The rigid motion between two sequences of fingerprints, and how well it is known (arXiv 2206.08733, section III)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2


@dataclass(frozen=True, slots=True, eq=False)
class SequenceFit:
    """T_a_b between the frames of two keyframes, with its (3, 3) covariance in (x, y, theta) of a.

    `points_a` and `points_b` (n, 2) m are the paired places, each in its own frame; `residual_m` their mean distance
    after the fit.
    """

    T_a_b: Pose2
    covariance: Floats
    residual_m: float
    points_a: Floats
    points_b: Floats


def fit_sequence(
    similarity: NDArray[np.float64], places_a: Floats, places_b: Floats, neighbours: int, independent_m: float
) -> SequenceFit:
    """Fit T_a_b to the (n, m) `similarity` of the places (n, 2) in b's frame to the places (m, 2) in a's.

    Each of b's places is paired with the weighted mean of its `neighbours` most similar ones of a; stretches of
    `independent_m` of path count as one independent fix in the covariance.
    """
    best = np.argsort(-similarity, axis=1, kind="stable")[:, :neighbours]
    weights = np.take_along_axis(similarity, best, axis=1) + 1e-9
    points_a = (places_a[best] * weights[..., None]).sum(axis=1) / weights.sum(axis=1, keepdims=True)
    T = rigid_motion(places_b, points_a)
    errors = points_a - T.transform(places_b)
    length = float(np.hypot(*np.diff(places_b, axis=0).T).sum())
    fixes = max(1.0, length / independent_m)
    covariance = _covariance(T, places_b, errors, fixes)
    return SequenceFit(T, covariance, float(np.hypot(*errors.T).mean()), points_a, places_b)


def rigid_motion(source: Floats, target: Floats) -> Pose2:
    """The T that brings (n, 2) `source` nearest to `target` in the least squares sense (Umeyama's, in the plane)."""
    ms, mt = source.mean(axis=0), target.mean(axis=0)
    s, t = source - ms, target - mt
    theta = math.atan2(float((s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]).sum()), float((s * t).sum()))
    x, y = mt - Pose2(0.0, 0.0, theta).transform(ms[None])[0]
    return Pose2.of((x, y, theta))


def _covariance(T: Pose2, points: Floats, errors: Floats, fixes: float) -> Floats:
    """Least squares covariance of T, as if there were `fixes` independent pairs with the spread of the errors seen."""
    variance = max(float((errors**2).sum(axis=1).mean()) / 2, 0.25)
    rotated = Pose2(0.0, 0.0, T.theta).transform(points)
    J = np.zeros((len(points), 2, 3))
    J[:, 0, 0] = J[:, 1, 1] = 1.0
    J[:, 0, 2], J[:, 1, 2] = -rotated[:, 1], rotated[:, 0]
    information = np.einsum("nij,nik->jk", J, J) / len(points) * fixes / variance
    covariance: Floats = np.linalg.inv(information + 1e-6 * np.eye(3))
    return covariance
