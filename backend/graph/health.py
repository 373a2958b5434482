"""The state of the estimate: how far the pose can be trusted."""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from wayfi.backend.pose2 import Floats


class State(StrEnum):
    """How far the pose can be trusted."""

    RELOCALISING = "RELOCALISING"
    TRACKING = "TRACKING"
    UNCERTAIN = "UNCERTAIN"
    LOST = "LOST"


class FailureCategory(StrEnum):
    """What keeps the pose from being trusted, for programs; the reason says it in words."""

    NONE = "none"
    NOT_FOUND_YET = "not_found_yet"
    AMBIGUOUS = "ambiguous"
    FLOOR_UNKNOWN = "floor_unknown"
    NOT_IN_MAP = "not_in_map"
    NO_SENSOR = "no_sensor"
    NO_FIX = "no_fix"
    MAP_CONTRADICTED = "map_contradicted"
    WIFI_ELSEWHERE = "wifi_elsewhere"
    ROBOT_MOVED = "robot_moved"
    POSE_IMPRECISE = "pose_imprecise"


@dataclass(frozen=True, slots=True)
class Health:
    """A state, the reason for it, and the kind of failure that it is."""

    state: State
    reason: str
    failure_category: FailureCategory = FailureCategory.NONE


SEVERITY = {State.TRACKING: 0, State.UNCERTAIN: 1, State.RELOCALISING: 2, State.LOST: 3}


def worse(one: Health | None, other: Health) -> Health:
    """The worse of two; the first where they are alike."""
    return one if one and SEVERITY[one.state] >= SEVERITY[other.state] else other


def position_sigma(covariance: Floats) -> float:
    """The standard deviation (m) along the worst direction of a (3, 3) pose covariance."""
    return math.sqrt(max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0))


def judge_health(covariance: Floats, uncertain_sigma_m: float, lost_sigma_m: float) -> Health:
    """The state of a pose with this (3, 3) covariance in `map`."""
    sigma = position_sigma(covariance)
    if not sigma < lost_sigma_m:
        return Health(
            State.LOST, f"position known to {sigma:.1f} m, over {lost_sigma_m:g} m", FailureCategory.POSE_IMPRECISE
        )
    if sigma >= uncertain_sigma_m:
        return Health(
            State.UNCERTAIN,
            f"position known to {sigma:.1f} m, over {uncertain_sigma_m:g} m",
            FailureCategory.POSE_IMPRECISE,
        )
    return Health(State.TRACKING, f"position known to {sigma:.2f} m")
