"""factors_*.parquet: the pose graph, to the bit. What a kind of factor has not is NaN, and a whole number 0."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from wayfi.backend.graph.factors import AxisFactor, BetweenFactor, Factor, NearFactor, WallFactor, WheelFactor
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.recordings.map.columns import Table, parquet

KINDS = {BetweenFactor: "between", WheelFactor: "wheel", NearFactor: "near", AxisFactor: "axis", WallFactor: "wall"}
POSE = ["x_m", "y_m", "theta_rad"]
COVARIANCE = [f"c{a}{b}" for a in "xyt" for b in "xyt"]
WAY = ["path_m", "seconds"]
PLACES = ["place_a_x_m", "place_a_y_m", "place_b_x_m", "place_b_y_m"]
NUMBERS = [*POSE, *COVARIANCE, *WAY, *PLACES, "sigma"]
WHOLE = ["discontinuities", "wing"]


def factor_table(numbers: Sequence[int], factors: Sequence[Factor]) -> bytes:
    """The factors `numbers`."""
    values = np.array([_values(factor) for factor in factors]).reshape(-1, len(NUMBERS))
    whole = np.array([_whole(factor) for factor in factors], np.int64).reshape(-1, len(WHOLE))
    columns: dict[str, Any] = {
        "factor": np.array(numbers, np.int64),
        "kind": np.array([KINDS[type(factor)] for factor in factors], np.str_),
        "a": np.array([factor.a for factor in factors], np.int64),
        "b": np.array([factor.b for factor in factors], np.int64),
        **{name: values[:, k] for k, name in enumerate(NUMBERS)},
        **{name: whole[:, k] for k, name in enumerate(WHOLE)},
        "alone": np.array([isinstance(factor, WheelFactor) and factor.alone for factor in factors], bool),
    }
    return parquet(columns)


def read_factors(table: Table) -> dict[int, Factor]:
    """The factors in a table by their numbers. Raises KeyError or ValueError for a table of another kind."""
    poses = [Pose2(*row) for row in table.matrix(POSE).tolist()]
    covariances = table.matrix(COVARIANCE).reshape(-1, 3, 3)
    places, sigmas = table.matrix(PLACES).reshape(-1, 2, 2), table.values("sigma")
    ways, whole = table.matrix(WAY).tolist(), zip(*map(table.values, WHOLE), strict=True)
    ends = zip(*map(table.values, ["factor", "kind", "a", "b", "alone"]), strict=True)
    read: dict[int, Factor] = {}
    for k, ((number, kind, a, b, alone), (breaks, wing)) in enumerate(zip(ends, whole, strict=True)):
        match kind:
            case "between":
                read[number] = BetweenFactor(a, b, poses[k], covariances[k])
            case "wheel":
                path_m, seconds = ways[k]
                motion = WheelMotion(poses[k], path_m, seconds, breaks)
                read[number] = WheelFactor(a, b, motion, covariances[k], alone)
            case "near":
                read[number] = NearFactor(a, b, places[k, 0], places[k, 1], sigmas[k])
            case "axis":
                read[number] = AxisFactor(b, wing, poses[k].theta, sigmas[k])
            case "wall":
                read[number] = WallFactor(b, wing, poses[k].theta, sigmas[k])
            case _:
                raise ValueError(f"factor {number} is of the kind {kind!r}, which this wayfi does not know")
    return read


def _values(factor: Factor) -> list[float]:
    """The NUMBERS of a factor."""
    pose, covariance, way, places, sigma = [math.nan] * 3, [math.nan] * 9, [math.nan] * 2, [math.nan] * 4, math.nan
    match factor:
        case BetweenFactor():
            pose, covariance = _numbers(factor.T_a_b), _flat(factor.covariance)
        case WheelFactor():
            pose, covariance = _numbers(factor.motion.pose), _flat(factor.covariance)
            way = [factor.motion.path_m, factor.motion.seconds]
        case NearFactor():
            places, sigma = [*factor.place_a, *factor.place_b], factor.sigma_m
        case AxisFactor():
            pose, sigma = [math.nan, math.nan, factor.turned], factor.sigma_rad
    return [*pose, *covariance, *way, *places, sigma]


def _whole(factor: Factor) -> list[int]:
    """The WHOLE numbers of a factor."""
    discontinuities = factor.motion.discontinuities if isinstance(factor, WheelFactor) else 0
    return [discontinuities, factor.wing if isinstance(factor, AxisFactor) else 0]


def _numbers(T: Pose2) -> list[float]:
    return [T.x, T.y, T.theta]


def _flat(covariance: Floats) -> list[float]:
    flat: list[float] = covariance.ravel().tolist()
    return flat
