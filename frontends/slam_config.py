"""The settings of the estimation, by section."""

from dataclasses import dataclass, field

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.grid.map_config import MapConfig
from wayfi.frontends.closures.closure_config import ClosureConfig
from wayfi.frontends.floors.floor_config import FloorConfig
from wayfi.frontends.frames.frames_config import FramesConfig
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.localization.localization_config import LocalizationConfig
from wayfi.frontends.maps.merging_config import MergingConfig
from wayfi.frontends.maps.pruning import PruningConfig
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.wifi.wifi_config import WifiConfig


@dataclass(frozen=True)
class SlamConfig:
    """All settings of the estimation."""

    frames: FramesConfig = field(default_factory=FramesConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    lidar: LidarConfig = field(default_factory=LidarConfig)
    wifi: WifiConfig = field(default_factory=WifiConfig)
    closure: ClosureConfig = field(default_factory=ClosureConfig)
    backend: BackendConfig = field(default_factory=BackendConfig)
    floors: FloorConfig = field(default_factory=FloorConfig)
    map: MapConfig = field(default_factory=MapConfig)
    pruning: PruningConfig = field(default_factory=PruningConfig)
    localization: LocalizationConfig = field(default_factory=LocalizationConfig)
    merging: MergingConfig = field(default_factory=MergingConfig)
