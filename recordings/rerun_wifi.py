"""What WiFi says: the APs heard, which earlier fingerprints are similar, and the two sequences of a candidate."""

from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.frontends.events import FingerprintAdded, SequenceMatched
from wayfi.recordings.rerun_config import RerunConfig
from wayfi.recordings.rerun_poses import KeyframePoses
from wayfi.recordings.rerun_stream import Limiter, Stream, mirror, segments
from wayfi.recordings.rerun_style import HERE, PAIRING, SEQUENCE_A, SEQUENCE_B, ui

MOST_SIMILAR = 256  # the similarity is shown to so many earlier fingerprints: the log stays linear
STRONGEST = 12
FLOOR_DBM = -100.0
UNLIKE, ALIKE = np.array([40.0, 55.0, 80.0]), np.array([255.0, 215.0, 60.0])


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a fingerprint was taken."""

    keyframe: int
    T_keyframe_base: Pose2


class Wifi:
    """Draws `/wifi/rssi`, `/wifi/strongest`, `/wifi/similarity`, `/wifi/places` and `/wifi/sequences`."""

    def __init__(self, stream: Stream, config: RerunConfig, poses: KeyframePoses) -> None:
        self._stream = stream
        self._limit = Limiter(config.wifi_hz)
        self._poses = poses
        self._number_of_ap: dict[str, int] = {}
        self._places: dict[int, _Place] = {}
        self._style()

    def on_fingerprint(self, event: FingerprintAdded) -> None:
        """The newest fingerprint."""
        self._places[event.fingerprint] = _Place(event.keyframe, event.T_keyframe_base)
        for bssid in event.bssids:
            self._number_of_ap.setdefault(bssid, len(self._number_of_ap))
        if self._limit.passes(event.stamp_ns):
            self._draw_rssi(event)
            self._draw_similarity(event)

    def on_sequences(self, event: SequenceMatched) -> None:
        """The two sequences of the last candidate, each pair joined by a line."""
        for name, points in (("a", event.points_a), ("b", event.points_b)):
            points = points.astype(np.float32)
            parts = (rr.LineStrips2D.from_fields(strips=[points]), rr.Points2D.from_fields(positions=points))
            self._stream.log(f"/wifi/sequences/{name}", *parts)
        lines = segments(event.points_a, event.points_b)
        self._stream.log("/wifi/sequences/pairs", rr.LineStrips2D.from_fields(strips=lines))

    def _draw_rssi(self, event: FingerprintAdded) -> None:
        numbers = np.array([self._number_of_ap[bssid] for bssid in event.bssids], np.float32)
        heard = np.isfinite(event.rssi)
        above_floor = np.maximum(event.rssi[heard] - FLOOR_DBM, 0.0).astype(np.float32)
        if len(above_floor):
            self._stream.log("/wifi/rssi", rr.BarChart(above_floor, abscissa=numbers[heard], color=SEQUENCE_A))
        self._stream.log("/wifi/strongest", rr.TextDocument(self._table(event), media_type="text/markdown"))

    def _table(self, event: FingerprintAdded) -> str:
        title = f"Fingerprint {event.fingerprint}, receiver `{event.receiver}`: {len(event.bssids)} APs"
        order = np.argsort(-np.nan_to_num(event.rssi, nan=-np.inf), kind="stable")[:STRONGEST]
        rows = [f"| {self._number_of_ap[event.bssids[i]]} | {event.bssids[i]} | {event.rssi[i]:.0f} |" for i in order]
        return "\n".join([title, "", "| AP | BSSID | dBm |", "|--:|---|--:|", *rows])

    def _draw_similarity(self, event: FingerprintAdded) -> None:
        best = np.argsort(-event.similarity, kind="stable")[:MOST_SIMILAR]
        best = best[np.argsort(event.similar_to[best])]
        numbers, similarity = event.similar_to[best], event.similarity[best].astype(np.float32)
        if len(numbers):
            chart = rr.BarChart(similarity, abscissa=numbers.astype(np.float32), color=SEQUENCE_B)
            self._stream.log("/wifi/similarity", chart)
        known = np.array([int(n) in self._places for n in numbers], bool)
        places = self._where([int(n) for n in numbers[known]])
        by_similarity = np.argsort(similarity[known], kind="stable")
        points = rr.Points2D.from_fields(
            positions=places[by_similarity], colors=_shade(similarity[known][by_similarity])
        )
        self._stream.log("/wifi/places/similar", points)
        self._stream.log("/wifi/places/here", rr.Points2D.from_fields(positions=self._where([event.fingerprint])))

    def _where(self, fingerprints: list[int]) -> Floats:
        """(n, 2) m in `map`, as believed now."""
        places = [self._places[number] for number in fingerprints]
        if not places:
            return np.zeros((0, 2))
        T_map_keyframe = self._poses.array()[[place.keyframe for place in places]]
        return compose_all(T_map_keyframe, np.array([place.T_keyframe_base.array() for place in places]))[:, :2]

    def _style(self) -> None:
        for root in ("/wifi/places", "/wifi/sequences"):
            self._stream.style(root, mirror())
        self._stream.style("/wifi/places/similar", rr.Points2D.from_fields(radii=[ui(3.0)], draw_order=5.0))
        here = rr.Points2D.from_fields(colors=[HERE], radii=[ui(5.0)], draw_order=6.0)
        self._stream.style("/wifi/places/here", here)
        for name, color in (("a", SEQUENCE_A), ("b", SEQUENCE_B)):
            lines = rr.LineStrips2D.from_fields(colors=[color], radii=[ui(1.0)], draw_order=8.0)
            points = rr.Points2D.from_fields(colors=[color], radii=[ui(2.5)], draw_order=9.0)
            self._stream.style(f"/wifi/sequences/{name}", lines, points)
        pairs = rr.LineStrips2D.from_fields(colors=[PAIRING], radii=[ui(0.5)], draw_order=7.0)
        self._stream.style("/wifi/sequences/pairs", pairs)


def _shade(similarity: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(n, 3) colours, from unlike (0) to alike (1)."""
    shade: NDArray[np.float64] = UNLIKE + np.clip(similarity, 0, 1)[:, None] * (ALIKE - UNLIKE)
    return np.rint(shade).astype(np.uint8)
