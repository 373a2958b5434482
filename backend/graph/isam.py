"""iSAM2 as the pose graph uses it."""

import gtsam
import numpy as np

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.gtsam_factors import calibration_key
from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.backend.pose2 import Floats


def new_isam(config: BackendConfig, prior: WheelCalibration, calibration: Floats) -> gtsam.ISAM2:
    """An iSAM2 that holds only the wheels' first calibration, with its `prior`, linearised at `calibration` (4,)."""
    isam = gtsam.ISAM2(_params(config))
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    graph.addPriorVector(calibration_key(0), prior.values, gtsam.noiseModel.Diagonal.Sigmas(prior.sigmas))
    values.insert(calibration_key(0), calibration)
    isam.update(graph, values)
    return isam


def _params(config: BackendConfig) -> gtsam.ISAM2Params:
    thresholds = gtsam.ISAM2ThresholdMap()
    thresholds.insert(("x", np.array([config.relinearize_m, config.relinearize_m, config.relinearize_rad])))
    thresholds.insert(("c", np.full(4, config.relinearize_calibration)))
    thresholds.insert(("d", np.full(1, config.relinearize_rad)))
    params = gtsam.ISAM2Params()
    params.setRelinearizeThreshold(thresholds)
    params.setFactorization("QR")  # Cholesky breaks down over long chains of wheels with one loose calibration
    params.relinearizeSkip = 1  # look for states to relinearise at every update
    params.enablePartialRelinearizationCheck = True
    return params
