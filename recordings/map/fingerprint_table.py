"""fingerprints_*.parquet and access_points.parquet: what was heard where, and how well each access point tells it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.maps.building_map import MapFingerprint
from wayfi.frontends.wifi.readings import Readings
from wayfi.recordings.map.columns import Table, lists, parquet, word_lists
from wayfi.recordings.map.factor_table import POSE

BSSIDS = "bssids.list.element"


def fingerprint_table(numbers: Sequence[int], fingerprints: Sequence[MapFingerprint]) -> bytes:
    """The fingerprints `numbers`."""
    placed = [f.T_keyframe_base for f in fingerprints]
    poses = np.array([[T.x, T.y, T.theta] for T in placed]).reshape(-1, 3)
    columns: dict[str, Any] = {
        "fingerprint": np.array(numbers, np.int64),
        "stamp_ns": np.array([f.stamp_ns for f in fingerprints], np.int64),
        "receiver": np.array([f.receiver for f in fingerprints], np.str_),
        "keyframe": np.array([f.keyframe for f in fingerprints], np.int64),
        **{name: poses[:, k] for k, name in enumerate(POSE)},
        "path_m": np.array([f.path_m for f in fingerprints], np.float64),
        "bssids": word_lists([f.readings.bssids for f in fingerprints]),
        "rssi_dbm": lists([f.readings.rssi for f in fingerprints]),
        "age_s": lists([f.readings.age_s for f in fingerprints]),
    }
    return parquet(columns)


def read_fingerprints(table: Table) -> dict[int, MapFingerprint]:
    """The fingerprints in a table by their numbers. Raises KeyError or ValueError for a table of another kind."""
    readings = map(Readings, table.words("bssids"), table.lists("rssi_dbm"), table.lists("age_s"))
    names = ["fingerprint", "stamp_ns", "receiver", "keyframe", "path_m"]
    rows = zip(*map(table.values, names), table.matrix(POSE).tolist(), readings, strict=True)
    return {
        number: MapFingerprint(stamp_ns, receiver, keyframe, Pose2(*pose), path_m, heard)
        for number, stamp_ns, receiver, keyframe, path_m, pose, heard in rows
    }


def access_point_table(weights: Mapping[str, float]) -> bytes:
    """The weight of each access point."""
    values = np.array(list(weights.values()), np.float64)
    return parquet({"bssid": np.array(list(weights), np.str_), "weight": values})


def read_weights(table: Table) -> dict[str, float]:
    """The weight of each access point in a table. Raises KeyError or ValueError for a table of another kind."""
    return dict(zip(table.values("bssid"), table.values("weight"), strict=True))
