"""WiFi: the APs of the newest fingerprint, similar earlier fingerprints, and the sequences of a candidate."""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, compose_all
from wayfi.frontends.events import FingerprintAdded, SequenceMatched
from wayfi.recordings.rerun import arrows
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.limiter import Limiter
from wayfi.recordings.rerun.stream import RerunStream, flip_y, segments
from wayfi.recordings.rerun.style import HERE, PAIRING, SEQUENCE_A, SEQUENCE_B, screen_radius
from wayfi.recordings.rerun.views.poses import Poses
from wayfi.recordings.rerun.views.view import Handlers

SIMILAR_SHOWN = 256  # most similar earlier fingerprints; a bound keeps the log linear in the drive
APS_LISTED = 12
FLOOR_DBM = -100.0
DISSIMILAR_COLOR, SIMILAR_COLOR = np.array([40.0, 55.0, 80.0]), np.array([255.0, 215.0, 60.0])


class WifiView:
    """Draws `/wifi/rssi`, `/wifi/strongest`, `/wifi/similarity`, `/wifi/places` and `/wifi/sequences`."""

    def __init__(self, stream: RerunStream, config: RerunConfig, poses: Poses) -> None:
        self._stream = stream
        self._limit = Limiter(config.wifi_hz)
        self._poses = poses
        self._number_of_ap: dict[str, int] = {}
        self._keyframe_of: list[int] = []
        self._T_keyframe_base = Poses()
        self._log_style()

    def handlers(self) -> Handlers:
        """The method that draws each kind of event."""
        return {FingerprintAdded: self.on_fingerprint, SequenceMatched: self.on_sequences}

    def on_fingerprint(self, event: FingerprintAdded) -> None:
        """Draw the newest fingerprint and its similarity to earlier ones."""
        self._store_position(event)
        for bssid in event.bssids:
            self._number_of_ap.setdefault(bssid, len(self._number_of_ap))
        if self._limit.passes(event.stamp_ns):
            self._draw_rssi(event)
            self._draw_similarity(event)

    def on_sequences(self, event: SequenceMatched) -> None:
        """Draw the two sequences of the last candidate, and a line between each pair of fingerprints."""
        for name, points in (("a", event.points_a), ("b", event.points_b)):
            parts = (
                rr.LineStrips2D.from_fields(strips=arrows.strips([points])),
                rr.Points2D.from_fields(positions=arrows.points(points)),
            )
            self._stream.log(f"/wifi/sequences/{name}", *parts)
        lines = segments(event.points_a, event.points_b)
        self._stream.log("/wifi/sequences/pairs", rr.LineStrips2D.from_fields(strips=arrows.strips(lines)))

    def _draw_rssi(self, event: FingerprintAdded) -> None:
        above_floor = np.zeros(len(self._number_of_ap), np.float32)
        numbers = [self._number_of_ap[bssid] for bssid in event.bssids]
        above_floor[numbers] = np.nan_to_num(event.rssi - FLOOR_DBM, nan=0.0).clip(min=0.0)
        if len(above_floor):
            self._stream.log("/wifi/rssi", rr.BarChart.from_fields(values=arrows.tensor(above_floor), color=SEQUENCE_A))
        self._stream.log("/wifi/strongest", rr.TextDocument(self._table(event), media_type="text/markdown"))

    def _table(self, event: FingerprintAdded) -> str:
        title = f"Fingerprint {event.fingerprint}, receiver `{event.receiver}`: {len(event.bssids)} APs"
        order = np.argsort(-np.nan_to_num(event.rssi, nan=-np.inf), kind="stable")[:APS_LISTED]
        rows = [f"| {self._number_of_ap[event.bssids[i]]} | {event.bssids[i]} | {event.rssi[i]:.0f} |" for i in order]
        return "\n".join([title, "", "| AP | BSSID | dBm |", "|--:|---|--:|", *rows])

    def _draw_similarity(self, event: FingerprintAdded) -> None:
        best = np.argsort(-event.similarity, kind="stable")[:SIMILAR_SHOWN]
        best = best[np.argsort(event.similar_to[best])]
        numbers, similarity = event.similar_to[best], event.similarity[best].astype(np.float32)
        if len(numbers):
            chart = rr.BarChart.from_fields(
                values=arrows.tensor(similarity), abscissa=arrows.tensor(numbers), color=SEQUENCE_B
            )
            self._stream.log("/wifi/similarity", chart)
        by_similarity = np.argsort(similarity, kind="stable")
        places = self._positions(numbers[by_similarity])
        points = rr.Points2D.from_fields(positions=arrows.points(places), colors=_colors(similarity[by_similarity]))
        self._stream.log("/wifi/places/similar", points)
        here = self._positions(np.array([event.fingerprint]))
        self._stream.log("/wifi/places/here", rr.Points2D.from_fields(positions=arrows.points(here)))

    def _store_position(self, event: FingerprintAdded) -> None:
        missing = event.fingerprint + 1 - len(self._keyframe_of)
        self._keyframe_of.extend([event.keyframe] * missing)
        self._T_keyframe_base.put(event.fingerprint, event.T_keyframe_base)

    def _positions(self, fingerprints: NDArray[np.int64]) -> Floats:
        """(n, 2) current positions of `fingerprints` (n,) in `map`, m."""
        T_map_keyframe = self._poses.array()[np.array(self._keyframe_of)[fingerprints]]
        return compose_all(T_map_keyframe, self._T_keyframe_base.array()[fingerprints])[:, :2]

    def _log_style(self) -> None:
        for root in ("/wifi/places", "/wifi/sequences"):
            self._stream.log_static(root, flip_y())
        self._stream.log_static(
            "/wifi/places/similar", rr.Points2D.from_fields(radii=[screen_radius(3.0)], draw_order=5.0)
        )
        here = rr.Points2D.from_fields(colors=[HERE], radii=[screen_radius(5.0)], draw_order=6.0)
        self._stream.log_static("/wifi/places/here", here)
        for name, color in (("a", SEQUENCE_A), ("b", SEQUENCE_B)):
            lines = rr.LineStrips2D.from_fields(colors=[color], radii=[screen_radius(1.0)], draw_order=8.0)
            points = rr.Points2D.from_fields(colors=[color], radii=[screen_radius(2.5)], draw_order=9.0)
            self._stream.log_static(f"/wifi/sequences/{name}", lines, points)
        pairs = rr.LineStrips2D.from_fields(colors=[PAIRING], radii=[screen_radius(0.5)], draw_order=7.0)
        self._stream.log_static("/wifi/sequences/pairs", pairs)


def _colors(similarity: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(n, 3) colours of similarities (n,) from 0 to 1."""
    share = np.clip(similarity, 0, 1)[:, None]
    colors: NDArray[np.float64] = DISSIMILAR_COLOR + share * (SIMILAR_COLOR - DISSIMILAR_COLOR)
    return np.rint(colors).astype(np.uint8)
