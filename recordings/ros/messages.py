"""The ROS 2 message types that wayfi reads and publishes: the typestore, schemas and default topics."""

from functools import lru_cache
from types import MappingProxyType

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from wayfi.frontends.measurements import Sensor

WIFI_SCAN_DEFINITION = """\
std_msgs/Header header          # stamp: when the scan ended; frame_id: which receiver (each has its own offset)
wifi_msgs/WifiReading[] readings
================================================================================
MSG: wifi_msgs/WifiReading
string bssid                    # aa:bb:cc:dd:ee:ff
string ssid
float32 rssi                    # dBm
uint32 frequency                # MHz, 0 if unknown
float32 age                     # s between this reading and the header's stamp, 0 if unknown
"""

ODOMETRY = "nav_msgs/msg/Odometry"
LASER_SCAN = "sensor_msgs/msg/LaserScan"
POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
WIFI_SCAN = "wifi_msgs/msg/WifiScan"
TF_MESSAGE = "tf2_msgs/msg/TFMessage"
POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
OCCUPANCY_GRID = "nav_msgs/msg/OccupancyGrid"
DIAGNOSTIC_ARRAY = "diagnostic_msgs/msg/DiagnosticArray"

TYPE_OF_SENSOR = MappingProxyType(
    {
        Sensor.ODOM: ODOMETRY,
        Sensor.SCAN: LASER_SCAN,
        Sensor.POINTS: POINT_CLOUD,
        Sensor.WIFI: WIFI_SCAN,
        Sensor.TF: TF_MESSAGE,
        Sensor.TF_STATIC: TF_MESSAGE,
        Sensor.INITIAL_POSE: POSE_WITH_COVARIANCE,
        Sensor.FIX: POSE_WITH_COVARIANCE,
    }
)
# (9,) indices of the rows and columns (x, y, theta) of a 6 x 6 covariance in the (36,) array of a message.
PLANAR_INDICES = np.array([6 * row + column for row in (0, 1, 5) for column in (0, 1, 5)])
DEFAULT_TOPICS = MappingProxyType({sensor: f"/{sensor}" for sensor in Sensor})
_SENSOR_OF_TYPE = {type_name: sensor for sensor, type_name in TYPE_OF_SENSOR.items()}


def _build_typestore() -> Typestore:
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(WIFI_SCAN_DEFINITION, WIFI_SCAN))
    return store


TYPESTORE = _build_typestore()


def canonical_type(type_name: str) -> str:
    """`type_name` as `package/msg/Name`, from that, `package/Name` or the DDS form `package::msg::dds_::Name_`."""
    if "::" in type_name:
        type_name = type_name.replace("::dds_::", "::").removesuffix("_").replace("::", "/")
    parts = type_name.split("/")
    return f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else type_name


def sensor_of_type(type_name: str) -> Sensor | None:
    """The sensor whose messages have this type; None for other types."""
    return _SENSOR_OF_TYPE.get(canonical_type(type_name))


@lru_cache(maxsize=256)
def schema_text(type_name: str) -> str | None:
    """The ros2msg definition of `type_name` with its dependencies; None for an unknown type."""
    if type_name not in TYPESTORE.fielddefs:
        return None
    return TYPESTORE.generate_msgdef(type_name, ros_version=2)[0]
