"""How well the wheels' calibration foretells their heading error: a filter that knows the truth up to a keyframe."""

from dataclasses import dataclass

import numpy as np

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.walk_rate import WalkRate
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2, between_all, wrap_all
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior
from wayfi.recordings.simulation.run import Run, odometry

BACKEND, ODOMETRY = BackendConfig(), OdometryConfig()
RATES = np.array([BACKEND.walk_turn_scale, BACKEND.walk_turn_bias_rad_per_m, BACKEND.walk_turn_bias_rad_per_s])


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """Wheel motions from keyframe to keyframe: (n, 3) `regressors` (turn rad, path m, seconds), and (n,) `errors` rad.

    `errors` are true turns less measured ones; `variances` (n,) rad^2 is what a step's random error is taken to have.
    """

    regressors: Floats
    errors: Floats
    variances: Floats


def steps_of(run: Run, keyframes: Floats) -> Steps:
    """The steps between the true poses at the seconds `keyframes` (n + 1,)."""
    measured = np.array([message.pose.array() for message in odometry(run)])
    at = np.round(keyframes * 10).astype(int)
    turns = np.diff(np.unwrap(measured[:, 2])[at])
    path_m = np.diff(np.r_[0.0, np.hypot(*np.diff(measured[:, :2], axis=0).T).cumsum()][at])
    true = between_all(run.truth.poses[at[:-1]], run.truth.poses[at[1:]])[:, 2]
    variances = (
        ODOMETRY.sigma_theta_per_sqrt_m**2 * path_m
        + ODOMETRY.sigma_theta_per_sqrt_rad**2 * np.abs(turns)
        + ODOMETRY.sigma_still_rad**2
    )
    return Steps(np.column_stack([turns, path_m, np.diff(keyframes)]), wrap_all(true - turns), variances)


def foretold(steps: Steps, ahead: int) -> Floats:
    """(k,) squared errors over claimed variances of the heading `ahead` keyframes on, from each `ahead`-th keyframe.

    Before it, every true turn was seen, as a laser sees them; after it none. The calibration walks as those before have
    taught, and no slower than configured, as in a CalibrationChain.
    """
    state, covariance = np.zeros(3), np.diag(calibration_prior(ODOMETRY).sigmas[1:] ** 2)
    walk, ratios = WalkRate(RATES), []
    for k, (H, error, variance) in enumerate(zip(steps.regressors, steps.errors, steps.variances, strict=True)):
        rates = max(1.0, walk.factor) * RATES
        if k % ahead == 0 and k > 0 and k + ahead <= len(steps.errors):
            ratios.append(_ahead(steps, slice(k, k + ahead), state, covariance, rates))
        covariance = covariance + np.diag(rates**2) * H[1]
        gain = covariance @ H / (H @ covariance @ H + variance)
        state = state + gain * (error - H @ state)
        covariance = covariance - np.outer(gain, H) @ covariance
        learn(walk, H, error, variance)
    return np.array(ratios)


def learnt(steps: Steps) -> float:
    """The factor on the configured rates of the walk that a drive's steps teach."""
    walk = WalkRate(RATES)
    for H, error, variance in zip(steps.regressors, steps.errors, steps.variances, strict=True):
        learn(walk, H, error, variance)
    return walk.factor


def learn(walk: WalkRate, regressors: Floats, error: float, variance: float) -> None:
    """Let it see a step's true turn."""
    turn, path_m, seconds = regressors.tolist()
    walk.add(WheelMotion(Pose2(path_m, 0.0, turn), path_m, seconds), turn + error, variance)


def _ahead(steps: Steps, window: slice, state: Floats, covariance: Floats, rates: Floats) -> float:
    """Squared error over claimed variance of the sum of a window's turns."""
    H = steps.regressors[window]
    total = H.sum(axis=0)
    off = steps.errors[window].sum() - total @ state
    later = H[::-1].cumsum(axis=0)[::-1]  # what a step of the walk still acts on
    walked = ((later * rates) ** 2 * H[:, 1:2]).sum()
    return float(off**2 / (total @ covariance @ total + walked + steps.variances[window].sum()))
