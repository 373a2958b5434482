"""The keys of a fleet on Zenoh: `<prefix>/wayfi/keyframes/RUN/FILE` of a robot, `<prefix>/wayfi/common/map/FILE`."""

from wayfi.service.config import ZenohConfig
from wayfi.service.transport.zenoh_session import key_of

KEYFRAMES, COMMON = "wayfi/keyframes", "wayfi/common"
COMMON_MAP = "map"  # its name below COMMON


def keyframes_key(config: ZenohConfig) -> str:
    """Below which a daemon serves the maps of its runs."""
    return key_of(config, KEYFRAMES)


def common_key(config: ZenohConfig) -> str:
    """Below which a merging daemon serves the common map."""
    return key_of(config, COMMON)


def everywhere(key: str, file: str) -> str:
    """The key expression of a file of every map that any program serves below `key`."""
    return f"**/{key}/*/{file}"


def robot_and_run(key: str) -> tuple[str, str]:
    """The prefix of a robot, without slashes at its ends, and its run, in the key of a file of its map."""
    prefix, _, rest = key.rpartition(f"{KEYFRAMES}/")
    return prefix.strip("/"), rest.split("/")[0]
