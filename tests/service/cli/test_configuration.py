"""`wayfi config` prints the configuration in force, and what it prints is a configuration file."""

import tomllib
from pathlib import Path
from typing import Any

from command_line import one_object, wayfi

from wayfi.service.config import Config, config_dict


def keys(values: dict[str, Any]) -> list[tuple[str, ...]]:
    """Every key of a nested mapping, with those it is under."""
    inner = {name: keys(value) if isinstance(value, dict) else [()] for name, value in values.items()}
    return [(name, *key) for name, found in inner.items() for key in found]


def test_config_prints_every_key_with_its_reason_and_parses_back() -> None:
    done = wayfi("config")
    assert done.exit_code == 0
    assert tomllib.loads(done.stdout) == config_dict(Config())
    printed = done.stdout.splitlines()
    settings = [number for number, line in enumerate(printed) if " = " in line and not line.startswith("#")]
    assert len(settings) == len(keys(config_dict(Config()))) > 50
    for number in settings:
        assert printed[number - 1].startswith("# ")
        assert len(printed[number - 1]) > 10


def test_what_config_prints_is_a_configuration_file(tmp_path: Path) -> None:
    (tmp_path / "config.toml").write_text(wayfi("config", "--set", "wifi.enabled=false").stdout)
    again = one_object(wayfi("config", "--config", tmp_path / "config.toml", "--json"))
    assert again == config_dict(Config()) | {"wifi": config_dict(Config().wifi) | {"enabled": False}}


def test_defaults_then_files_in_their_order_then_settings_in_theirs(tmp_path: Path) -> None:
    first, second = tmp_path / "first.toml", tmp_path / "second.toml"
    first.write_text("[lidar]\nmax_range_m = 10.0\nthinning_m = 0.2\nmin_points = 40\n[lidar.trust]\nmost = 50.0\n")
    second.write_text("[lidar]\nthinning_m = 0.3\nmin_points = 50\n")
    files: list[str | Path] = ["--config", first, "--config", second]
    settings = ["--set", "lidar.min_points=60", "--set", "lidar.min_points=70", "--set", "recording.odom=/wheels"]
    values = one_object(wayfi("config", *settings, *files, "--json"))
    lidar = values["lidar"]
    assert (lidar["max_range_m"], lidar["thinning_m"], lidar["min_points"]) == (10.0, 0.3, 70)
    assert lidar["trust"] == config_dict(Config().lidar.trust) | {"most": 50.0}
    assert values["recording"]["odom"] == "/wheels"
    assert values["wifi"] == config_dict(Config().wifi)
