"""What is unknown or impossible is refused by name; files override defaults, and settings override files."""

from pathlib import Path
from typing import Any

import pytest
from configurations import at
from places import DEPLOY

from wayfi.backend.errors import WayfiError
from wayfi.service.config import Config, ConfigError, config_of, load_config


def file(tmp_path: Path, text: str, name: str = "c.toml") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


def test_defaults_give_way_to_files_and_files_to_settings(tmp_path: Path) -> None:
    first = file(tmp_path, "[wifi]\nnear_m = 2.0\nneighbouring_m = 11\nmin_readings = 3\n", "a.toml")
    second = file(tmp_path, "[wifi]\nneighbouring_m = 12\nmin_readings = 4\n[closure.consensus]\nsteps = 5\n", "b.toml")
    config = load_config([first, second], ["wifi.min_readings=5", "closure.consensus.drift=0.5"])
    assert (config.wifi.near_m, config.wifi.neighbouring_m, config.wifi.min_readings) == (2.0, 12, 5)
    assert (config.closure.consensus.steps, config.closure.consensus.drift) == (5, 0.5)
    assert config.wifi.min_near == Config().wifi.min_near


def test_the_last_setting_of_a_key_counts() -> None:
    assert load_config(settings=["wifi.min_readings=1", "wifi.min_readings=2"]).wifi.min_readings == 2


@pytest.mark.parametrize(
    ("setting", "path", "value"),
    [
        ("zenoh.mode=client", "zenoh.mode", "client"),
        ('zenoh.mode="client"', "zenoh.mode", "client"),
        ("recording.odom=/robot/odom", "recording.odom", "/robot/odom"),
        ("zenoh.prefix=a=b", "zenoh.prefix", "a=b"),
        ("lidar.enabled=false", "lidar.enabled", False),
        ("lidar.enabled = true", "lidar.enabled", True),
        ("lidar.max_range_m=10", "lidar.max_range_m", 10.0),
        ("lidar.mount=[1, 2, 3]", "lidar.mount", [1.0, 2.0, 3.0]),
        ('zenoh.connect=["tcp/10.0.0.1:7447"]', "zenoh.connect", ["tcp/10.0.0.1:7447"]),
    ],
)
def test_a_setting_is_a_toml_value_and_a_bare_word_a_string(setting: str, path: str, value: object) -> None:
    found = at(load_config(settings=[setting]), path)
    assert found == value
    assert type(found) is type(value)


# What is refused


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"wify": {}}, "wify"),
        ({"wifi": {"sigma": 1.0}}, "wifi.sigma"),
        ({"closure": {"consensus": {"step": 1}}}, "closure.consensus.step"),
        ({"wifi": 3}, "wifi"),
        ({"closure": {"consensus": "wide"}}, "closure.consensus"),
        ({"wifi": {"min_readings": "many"}}, "wifi.min_readings"),
        ({"wifi": {"min_readings": 1.5}}, "wifi.min_readings"),
        ({"lidar": {"enabled": "perhaps"}}, "lidar.enabled"),
        ({"lidar": {"mount": ["x"]}}, "lidar.mount"),
        ({"zenoh": {"listen": "tcp/127.0.0.1:7447"}}, "zenoh.listen"),
    ],
)
def test_an_unknown_key_or_a_value_that_does_not_fit_is_refused_by_name(values: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigError) as refused:
        config_of(values)
    assert str(refused.value).startswith(key)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("setting", ["wifi.window", "window=3", "=3", "wifi.=3", ".window=3", ""])
def test_a_setting_that_names_no_key_is_refused(setting: str) -> None:
    with pytest.raises(ConfigError, match=r"section\.key=VALUE"):
        load_config(settings=[setting])


def test_a_file_that_is_missing_or_no_toml_is_refused_by_name(tmp_path: Path) -> None:
    for path in (tmp_path / "none.toml", file(tmp_path, "[wifi\n"), tmp_path):
        with pytest.raises(WayfiError, match=path.name):
            load_config([path])
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"binary\.toml"):
        load_config([binary])


@pytest.mark.parametrize(
    "setting",
    [
        *("lidar.cell_m=0.0", "map.resolution_m=-1.0", "lidar.icp.sigma_m=nan", "lidar.mount=[1.0, 2.0]"),
        *("lidar.mount=[1.0, inf, 0.0]", "recording.directory=a\udcff", 'zenoh.listen=["\udcff"]'),
        *("zenoh.odom_queue=0", "zenoh.scan_queue=-1", "rerun.port=0", "rerun.port=65536"),
        *("odometry.share_spins=0.0", "odometry.axes.share_along=1.0", "lidar.walls.min_share=-0.1"),
    ],
)
def test_a_value_that_nothing_could_run_with_is_refused_by_name(setting: str) -> None:
    with pytest.raises(ConfigError, match=setting.partition("=")[0]):
        load_config((), [setting])


def test_the_example_for_a_robot_is_a_configuration() -> None:
    example = DEPLOY / "robot.toml"
    assert load_config([example]).recording.directory == "/var/lib/wayfi"
