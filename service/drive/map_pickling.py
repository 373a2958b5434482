"""Pickles a drive without the map that it localises in: objects of the map are named, and taken from it again."""

import io
import pickle
from typing import Any

from wayfi.frontends.maps.building_map import BuildingMap

Named = dict[int, int]


class MapPickling:
    """Pickles and unpickles objects that refer to a map, to whatever of it; None: there is no map."""

    def __init__(self, known: BuildingMap | None) -> None:
        self._objects = _objects_of(known) if known is not None else []
        self._numbers: Named = {id(each): number for number, each in enumerate(self._objects)}

    def dumps(self, value: object) -> bytes:
        """The pickled value."""
        file = io.BytesIO()
        _Pickler(file, self._numbers).dump(value)
        return file.getvalue()

    def loads(self, data: bytes) -> Any:  # noqa: ANN401 - as pickle's
        """The value that `dumps` made these bytes of, with the same map."""
        return _Unpickler(io.BytesIO(data), self._objects).load()


def _objects_of(known: BuildingMap) -> list[object]:
    """The large objects of a map, always in the same order."""
    parts: list[object] = [
        known,
        known.poses,
        *known.grids.values(),
        known.keyframes,
        known.fingerprints,
        known.factors,
    ]
    scans: list[object] = [keyframe.scan for keyframe in known.keyframes if keyframe.scan is not None]
    return [*parts, *known.keyframes, *scans, *(f.readings for f in known.fingerprints)]


class _Pickler(pickle.Pickler):
    def __init__(self, file: io.BytesIO, numbers: Named) -> None:
        super().__init__(file, protocol=pickle.HIGHEST_PROTOCOL)
        self._numbers = numbers

    def persistent_id(self, obj: Any) -> int | None:  # noqa: ANN401 - as pickle's
        return self._numbers.get(id(obj))


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, objects: list[object]) -> None:
        super().__init__(file)
        self._objects = objects

    def persistent_load(self, pid: Any) -> object:  # noqa: ANN401 - as pickle's
        return self._objects[pid]
