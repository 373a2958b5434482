"""Topics are found by type where only one fits; else the settings to choose from are named."""

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.ros.discovery import FoundTopics, find_topics
from wayfi.recordings.ros.messages import (
    DEFAULT_TOPICS,
    LASER_SCAN,
    ODOMETRY,
    POINT_CLOUD,
    POSE_WITH_COVARIANCE,
    TF_MESSAGE,
)
from wayfi.recordings.ros.topics import Channel


def found(*channels: tuple[str, str] | tuple[str, str, str], **configured: str) -> FoundTopics:
    whole = [Channel(*channel, *["cdr"] * (3 - len(channel))) for channel in channels]
    return find_topics(whole, {**DEFAULT_TOPICS, **{Sensor(name): topic for name, topic in configured.items()}})


def test_the_only_topic_of_a_type_is_read_and_told() -> None:
    sought = found(("/robot1/scan", "sensor_msgs/LaserScan"), ("/odom", ODOMETRY), ("/odom/filtered", ODOMETRY))
    assert sought.topics == {Sensor.SCAN: "/robot1/scan"}
    assert sought.warnings == ("/robot1/scan is read for scan (recording.scan); nothing can be read on /scan",)


def test_of_several_none_is_chosen_and_the_settings_are_named() -> None:
    sought = found(("/front/scan", LASER_SCAN), ("/rear/scan", LASER_SCAN), ("/odom", ODOMETRY))
    assert sought.topics == {}
    (line,) = sought.warnings
    settings = "give --set recording.scan=/front/scan or --set recording.scan=/rear/scan"
    assert line.endswith(f'{settings}, or to use them together --set \'recording.scan=["/front/scan", "/rear/scan"]\'')


def test_a_topic_that_was_asked_for_is_not_replaced() -> None:
    sought = found(("/scan", LASER_SCAN), ("/odom", ODOMETRY), scan="/front/scan")
    assert sought.topics == {}
    assert sought.warnings == ("nothing can be read on /front/scan (recording.scan); give --set recording.scan=/scan",)
    assert "no other topic fits" in found(("/odom", ODOMETRY), scan="/front/scan").warnings[0]
    assert found(("/front/scan", LASER_SCAN), scan="") == FoundTopics({}, ())


def test_a_configured_topic_of_another_type_is_as_if_it_were_absent() -> None:
    assert found(("/scan", POINT_CLOUD), ("/base_scan", LASER_SCAN)).topics == {Sensor.SCAN: "/base_scan"}


def test_json_on_the_configured_topic_is_read_whatever_its_type_is_called() -> None:
    assert found(("/scan", "", "json"), ("/base_scan", LASER_SCAN)).topics == {}


def test_clouds_are_sought_only_where_there_are_no_scans() -> None:
    assert found(("/camera/points", POINT_CLOUD), ("/base_scan", LASER_SCAN)).topics == {Sensor.SCAN: "/base_scan"}
    assert found(("/velodyne_points", POINT_CLOUD)).topics == {Sensor.POINTS: "/velodyne_points"}


def test_transforms_are_told_apart_by_name() -> None:
    sought = found(("/robot1/tf", TF_MESSAGE), ("/robot1/tf_static", TF_MESSAGE))
    assert sought.topics[Sensor.TF_STATIC] == "/robot1/tf_static"


def test_poses_from_outside_are_told_apart_by_name_and_no_other_pose_is_taken_for_one() -> None:
    sought = found(("/robot1/initialpose", POSE_WITH_COVARIANCE), ("/amcl_pose", POSE_WITH_COVARIANCE))
    assert sought.topics == {Sensor.INITIAL_POSE: "/robot1/initialpose"}
    assert found(("/fix", "sensor_msgs/msg/NavSatFix")) == FoundTopics({}, ())


def test_a_fitting_type_in_an_unknown_encoding_is_told_with_what_is_taken() -> None:
    sought = found(("/base_scan", LASER_SCAN, "protobuf"), ("/odom", ODOMETRY, "protobuf"))
    assert sought.topics == {}
    (line,) = sought.warnings  # that of /odom, which is configured, is told where its messages come
    assert line.startswith("/base_scan: not used: unknown encoding protobuf; scan takes cdr or json")


def test_all_topics_of_a_list_are_read_and_those_that_are_not_there_are_named() -> None:
    channels = [Channel("/front", "sensor_msgs/msg/LaserScan", "cdr"), Channel("/odom", "nav_msgs/msg/Odometry", "cdr")]
    sought = find_topics(channels, {Sensor.ODOM: "/odom", Sensor.SCAN: ("/front", "/rear")})
    assert sought == FoundTopics({}, ("nothing can be read on /rear (recording.scan)",))
