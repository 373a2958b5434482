"""How fast the wheels' calibration changes along the path, learnt from how scan matches contradict their turns."""

import math

import numpy as np

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, wrap

FACTORS = 2.0 ** np.arange(-2, 3)  # on the configured rates: real robots need 1/2 to 2, and a bias may yet leap
NOISES = 4.0 ** np.arange(-2, 3)  # on the claimed variances: claims that are too small would else pass for a walk
PRIOR_OCTAVES = 1.0  # sigma of both at first, around 1: of the rates that real robots were seen to need
PRIOR_SIGMAS = np.array([0.1, 0.06, 0.0005])  # of turn scale, turn bias (rad/m and rad/s): the most that was seen
SLIP_CHI2 = 9.0  # from 3 sigmas of the noisiest filter on a turn is no noise but a slip, which tells nothing of a walk


class WalkRate:
    """Kalman filters of the wheels' turn errors side by side, each with rates and a noise of its own.

    Each weighs as much as it has foretold what came (Magill, IEEE Transactions on Automatic Control 10, 1965). `rates`
    (3,) are the configured ones of turn scale, turn bias per metre and per second, for each square root of a metre;
    `factor` is what is to multiply them, as `path_m` of path have taught.
    """

    def __init__(self, rates: Floats) -> None:
        factor, self._noise = (grid.ravel() for grid in np.meshgrid(FACTORS, NOISES, indexing="ij"))
        self._logs = np.log(factor)
        self._walk = np.square(factor[:, None] * rates)
        self._weight = -0.5 * (np.log2(factor) ** 2 + np.log2(self._noise) ** 2) / PRIOR_OCTAVES**2
        self._mean = np.zeros((len(factor), 3))
        self._covariance = np.tile(np.diag(PRIOR_SIGMAS**2), (len(factor), 1, 1))
        self.factor, self.path_m = 1.0, 0.0

    def add(self, motion: WheelMotion, turn: float, variance: float) -> None:
        """A scan match saw the robot turn by `turn` (rad) in `motion`; `variance` (rad^2) is that of both together.

        The scale is that of the turn which was seen: what the wheels measure on a straight way is their error itself.
        """
        H = np.array([turn, motion.path_m, motion.seconds])
        self._covariance[:, range(3), range(3)] += self._walk * motion.path_m
        along = self._covariance @ H
        expected = along @ H + self._noise * variance
        error = wrap(turn - motion.pose.theta) - self._mean @ H
        chi2 = error**2 / expected
        if chi2.min() > SLIP_CHI2:
            return
        self.path_m += motion.path_m
        gain = along / expected[:, None]
        self._mean += gain * error[:, None]
        self._covariance -= gain[:, :, None] * along[:, None, :]
        self._weight -= 0.5 * (np.log(expected) + chi2)
        self._weight -= self._weight.max()
        share = np.exp(self._weight)
        self.factor = math.exp(share @ self._logs / share.sum())
