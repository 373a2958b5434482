"""What is not as it was when the map was made: access points, or the robot itself."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import Measurement, Odometry, StaticTransforms, Transform, WifiScan

# Of a stream of measurements and the addresses of the access points that the map knows.
Change = Callable[[Iterable[Measurement], Sequence[str]], Iterable[Measurement]]
SITE = len("02:00:00")  # characters of an address that the access points of a site have in common


def unchanged(measurements: Iterable[Measurement], known: Sequence[str]) -> Iterable[Measurement]:  # noqa: ARG001
    """Everything is as it was."""
    return measurements


def all_access_points_replaced(measurements: Iterable[Measurement], known: Sequence[str]) -> Iterator[Measurement]:  # noqa: ARG001
    """The access points stand where they stood, but have other addresses."""
    for m in measurements:
        yield replace(m, bssids=tuple(f"0a{bssid[2:]}" for bssid in m.bssids)) if isinstance(m, WifiScan) else m


def access_points_moved(share: float) -> Change:
    """This share of the sites of access points was moved to where another of them was."""

    def change(measurements: Iterable[Measurement], known: Sequence[str]) -> Iterator[Measurement]:
        heard_instead = _swapped(known, share)
        for m in measurements:
            if isinstance(m, WifiScan):
                yield replace(m, bssids=tuple(heard_instead.get(bssid, bssid) for bssid in m.bssids))
            else:
                yield m

    return change


def _swapped(bssids: Sequence[str], share: float) -> dict[str, str]:
    """For each address of a moved site, the one of another moved site that is heard in its place."""
    sites: dict[str, list[str]] = defaultdict(list)
    for bssid in sorted(bssids):
        sites[bssid[:SITE]].append(bssid)
    names = np.random.default_rng(7).permutation(sorted(sites))[: round(share * len(sites))].tolist()
    pairs = zip(names, names[1:] + names[:1], strict=True)
    return {old: new for a, b in pairs for old, new in zip(sites[a], sites[b], strict=False)}


def another_mount(T_old_new: Pose2) -> Change:
    """A robot whose base_link is elsewhere, `T_old_new` in the old one: laser and odometry tell of that base."""

    def change(measurements: Iterable[Measurement], known: Sequence[str]) -> Iterator[Measurement]:  # noqa: ARG001
        for m in measurements:
            if isinstance(m, Odometry):
                yield replace(m, pose=T_old_new.inverse() @ m.pose @ T_old_new)
            elif isinstance(m, StaticTransforms):
                yield replace(m, transforms=tuple(_remounted(t, T_old_new) for t in m.transforms))
            else:
                yield m

    return change


def _remounted(t: Transform, T_old_new: Pose2) -> Transform:
    x, y, z = t.translation_xyz
    _, _, sine, cosine = t.rotation_xyzw
    T = T_old_new.inverse() @ Pose2(x, y, 2 * np.arctan2(sine, cosine))
    half = float(np.sin(T.theta / 2)), float(np.cos(T.theta / 2))
    return replace(t, translation_xyz=(T.x, T.y, z), rotation_xyzw=(0.0, 0.0, *half))
