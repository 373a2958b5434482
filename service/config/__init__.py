"""The configuration of wayfi: its sections, and how they are read from and written to TOML."""

from wayfi.service.config.loading import ConfigError, config_of, load_config
from wayfi.service.config.sections import Config, RecordingConfig, SecurityConfig, ZenohConfig
from wayfi.service.config.writing import config_dict, config_toml

__all__ = [
    "Config",
    "ConfigError",
    "RecordingConfig",
    "SecurityConfig",
    "ZenohConfig",
    "config_dict",
    "config_of",
    "config_toml",
    "load_config",
]
