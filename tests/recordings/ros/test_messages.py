"""Type names and schemas."""

from wayfi.frontends.measurements import (
    Sensor,
)
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR, schema_text, sensor_of_type

SHARES = {Sensor.TF: Sensor.TF_STATIC, Sensor.INITIAL_POSE: Sensor.FIX}  # the type of the other


def test_types_are_known_by_every_name_they_go_by() -> None:
    for sensor, name in TYPE_OF_SENSOR.items():
        package, _, short = name.split("/")
        for form in (name, f"{package}/{short}", f"{package}::msg::dds_::{short}_"):
            assert sensor_of_type(form) is SHARES.get(sensor, sensor)
    assert sensor_of_type("std_msgs/msg/String") is None
    assert sensor_of_type("") is None


def test_schemas_hold_their_dependencies() -> None:
    text = schema_text(TYPE_OF_SENSOR[Sensor.WIFI])
    assert text is not None
    for name in ("std_msgs/Header", "builtin_interfaces/Time", "wifi_msgs/WifiReading"):
        assert f"{'=' * 80}\nMSG: {name}\n" in text
    assert schema_text("no_such/msg/Type") is None
