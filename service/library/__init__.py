"""wayfi as a library: `import wayfi` gives the names below, each loaded with what it needs when it is first used.

Modules of this folder import each other relatively, since it is installed as `wayfi` itself.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wayfi.backend.errors import WayfiError
    from wayfi.backend.graph.health import State
    from wayfi.backend.pose2 import Pose2
    from wayfi.recordings.files.map_folder import MapError
    from wayfi.recordings.files.result_folder import ResultError
    from wayfi.recordings.map.loading import LoadedMap, load_map

    from .arguments import ArgumentError
    from .recorded import replay
    from .results import Result, load_result
    from .slam import FinishedError, Slam

    __version__: str

__all__ = [
    "ArgumentError",
    "FinishedError",
    "LoadedMap",
    "MapError",
    "Pose2",
    "Result",
    "ResultError",
    "Slam",
    "State",
    "WayfiError",
    "__version__",
    "load_map",
    "load_result",
    "replay",
]

_MODULES = {
    "ArgumentError": ".arguments",
    "FinishedError": ".slam",
    "LoadedMap": ".recordings.map.loading",
    "MapError": ".recordings.files.map_folder",
    "Pose2": ".backend.pose2",
    "Result": ".results",
    "ResultError": ".recordings.files.result_folder",
    "Slam": ".slam",
    "State": ".backend.graph.health",
    "WayfiError": ".backend.errors",
    "load_map": ".recordings.map.loading",
    "load_result": ".results",
    "replay": ".recorded",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - each name has its own type, see above
    if name == "__version__":
        from importlib.metadata import version

        return version("wayfi")
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_MODULES[name], __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
