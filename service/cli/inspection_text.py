"""The diagnosis of a recording as text: lines of at most 80 columns where names allow it, none of them cut."""

import math
import textwrap
from collections.abc import Iterator
from itertools import groupby

from wayfi.recordings.inspecting.clocks import ClockInspection
from wayfi.recordings.inspecting.frames import FrameInspection
from wayfi.recordings.inspecting.motion import OdometryInspection
from wayfi.recordings.inspecting.radio import WifiInspection
from wayfi.recordings.inspecting.sweeps import CloudInspection, LaserInspection
from wayfi.recordings.inspection import Inspection, TopicInspection
from wayfi.service.replay.diagnosis import Diagnosis

COLUMNS = 80
NOTABLE_S, GRAVE_S = 0.05, 0.5  # between two clocks: more than the latencies of most drivers, and of all
LONG_STILL_S = 5.0
MOST_NAMES = 6


def lines_of(diagnosis: Diagnosis) -> Iterator[str]:
    """The lines to print."""
    inspection = diagnosis.inspection
    yield from _wrapped(f"{inspection.path}: {_lasts(inspection)}, {inspection.message_count} messages")
    for topic in sorted(inspection.topics, key=lambda topic: (not topic.used, topic.topic)):
        yield ""
        yield from _topic(topic)
    yield ""
    yield from _frames(inspection)
    warnings = [*inspection.warnings, *(w for w in diagnosis.trial.warnings if w not in inspection.frame_faults)]
    if warnings:
        yield ""
        yield f"Warnings, of the recording and of a replay of its first {_seconds(diagnosis.trial.seconds)}:"
        for warning in warnings:
            yield from _wrapped(f"! {warning}", "  ", "    ")
    yield ""
    if diagnosis.usable:
        yield from _wrapped(diagnosis.verdict, "", "")
        yield f"Next: {diagnosis.command}"


def _lasts(inspection: Inspection) -> str:
    logged_s, stamped_s = inspection.duration_s, inspection.stamped_s
    if stamped_s is None or abs(logged_s - stamped_s) < 0.1 * logged_s + 1.0:
        return _seconds(logged_s)
    return f"{_seconds(stamped_s)} by its stamps, {_seconds(logged_s)} by its log times"


def _topic(topic: TopicInspection) -> Iterator[str]:
    does = topic.why if topic.used else "is not used"
    kind = f"{topic.type_name or 'no type'}, {topic.encoding or 'no encoding'}"
    yield from _wrapped(f"{topic.topic} {does} ({kind})")
    if not topic.used:
        yield from _item(topic.why)
    yield from _item(_counts(topic))
    for reason, count in (topic.reasons or {}).items():
        yield from _item(f"! cannot be decoded, {count} times: {reason}")
    if topic.odometry is not None and topic.count > topic.undecodable:
        yield from _odometry(topic.odometry)
    if topic.laser is not None:
        yield from _laser(topic.laser, topic.rate_hz)
    if topic.cloud is not None:
        yield from _cloud(topic.cloud)
    if topic.wifi is not None and topic.wifi.scans:
        yield from _wifi(topic.wifi, topic.bssids or 0)
    if topic.clock is not None:
        yield from _clock(topic.clock)


def _counts(topic: TopicInspection) -> str:
    said = [f"{topic.count} message{'s' if topic.count != 1 else ''}"]
    if topic.rate_hz is not None:
        said[0] += f" at {topic.rate_hz:.3g} Hz" + (" by log time" if topic.rate_by == "log time" else "")
    if topic.longest_gap_s and topic.rate_hz and topic.longest_gap_s * topic.rate_hz > 3.0:
        said.append(f"longest gap {_seconds(topic.longest_gap_s)}")
    if topic.time_faults.jumps_back:
        said.append(f"stamps jump back {_times(topic.time_faults.jumps_back)}")
    if topic.time_faults.duplicates:
        said.append(f"stamps stay as they were {_times(topic.time_faults.duplicates)}")
    if topic.non_finite:
        said.append(f"{topic.non_finite} not finite")
    return ", ".join(said)


def _odometry(found: OdometryInspection) -> Iterator[str]:
    yield from _item(
        f"{found.path_m:.1f} m of path, up to {found.top_speed_m_s:.2f} m/s and {found.top_turn_rad_s:.2f} rad/s"
    )
    if found.longest_still_s > LONG_STILL_S:
        yield from _item(f"stands still for {_seconds(found.longest_still_s)} at the longest")
    if abs(found.twist_path_m - found.path_m) > 0.2 * max(found.path_m, 1.0) and found.twist_path_m > 0.0:
        yield from _item(f"! its velocities make a path of {found.twist_path_m:.1f} m")
    if len(found.child_frames) > 1:
        yield from _item(f"! poses of several frames: {_names(found.child_frames)}")


def _laser(found: LaserInspection, rate_hz: float | None) -> Iterator[str]:
    most = "any range" if found.range_max_m is None else f"{found.range_max_m:g} m"
    yield from _item(
        f"{found.beams} beams over {found.view_deg:.0f} degrees, {abs(found.step_deg):.3g} apart, "
        f"{found.range_min_m:.2g} m to {most}; {found.returns:.0f} return; frame {_names(found.frames)}"
    )
    if found.fault:
        yield from _item(f"! {found.fault}")
    if rate_hz and found.sweep_s > 1.2 / rate_hz:
        yield from _item(f"! a sweep is said to take {found.sweep_s:.3g} s, more than there is between scans")


def _cloud(found: CloudInspection) -> Iterator[str]:
    yield from _item(f"{found.points:.0f} points a cloud; frame {_names(found.frames)}")
    if found.heights_m is not None and found.in_band is not None:
        low, high = found.heights_m
        mark = "" if found.in_band > 0.01 else "! "
        share = f"{100 * found.in_band:.0f} % lie in the height band (lidar.cloud.low_m, lidar.cloud.high_m)"
        yield from _item(f"{mark}heights {low:.2f} to {high:.2f} m above the base; {share}")


def _wifi(found: WifiInspection, bssids: int) -> Iterator[str]:
    levels = "" if found.rssi_dbm is None else f", {found.rssi_dbm[0]:.0f} to {found.rssi_dbm[1]:.0f} dBm"
    yield from _item(f"{bssids} BSSIDs, {found.readings:.0f} usable readings a scan{levels}")
    yield from _item(f"receivers: {_names(found.scans)}")
    for reason, count in found.dropped.items():
        example = f", such as {found.odd_bssid!r}" if reason == "malformed_bssid" else ""
        yield from _item(f"! {count} readings cannot be used: {reason}{example}")


def _clock(found: ClockInspection) -> Iterator[str]:
    if found.still:
        yield from _item("! all stamps are the same: they do not move with time")
    elif found.steps:
        step = f"{'+' if found.largest_step_s > 0 else '-'}{_seconds(abs(found.largest_step_s))}"
        yield from _item(f"! its stamps step against log time {_times(found.steps)}, at most by {step}")
    elif not found.in_real_time and found.playback is not None:
        yield from _item(f"recorded from a playback at {found.playback:.3g} times real time")
    else:
        yield from _offsets(found)


def _offsets(found: ClockInspection) -> Iterator[str]:
    if abs(found.offset_s) > NOTABLE_S or found.spread_s > NOTABLE_S:
        side = "after" if found.offset_s > 0 else "before"
        yield from _item(f"stamped {_seconds(abs(found.offset_s))} {side} log time, spread {_seconds(found.spread_s)}")
    ahead_s = found.against_odometry_s
    if ahead_s is not None and abs(ahead_s) > NOTABLE_S:
        mark = "! " if abs(ahead_s) > GRAVE_S else ""
        side = "ahead of" if ahead_s > 0 else "behind"
        yield from _item(f"{mark}its clock is {_seconds(abs(ahead_s))} {side} the odometry's")


def _frames(inspection: Inspection) -> Iterator[str]:
    """The tree; neighbours that no sensor is at, and that nothing hangs on, share a line."""
    if inspection.frames:
        yield "Frames, and where lasers are on the base:"
    parents = {frame.parent for frame in inspection.frames}
    for (depth, alone), group in groupby(
        inspection.frames, lambda frame: (frame.depth, frame.frame if frame.of or frame.frame in parents else "")
    ):
        indent, frames = "  " * (depth + 1), list(group)
        text = _frame(frames[0]) if alone else ", ".join(frame.frame for frame in frames)
        yield from _wrapped(text, indent, indent + "    ")
    for fault in inspection.frame_faults:
        yield from _wrapped(f"! {fault}", "  ", "    ")


def _frame(found: FrameInspection) -> str:
    if not found.of:
        return found.frame
    if found.of == "odometry":
        return f"{found.frame} (the odometry's)"
    if found.mount is None:
        return f"{found.frame} (a laser's): not joined to the base"
    x, y, theta = found.mount
    return f"{found.frame} (a laser's): x {x:.2f} m, y {y:.2f} m, turned {math.degrees(theta):.0f} degrees"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _names(counts: dict[str, int]) -> str:
    """Names, each with its count where there are several."""
    if len(counts) == 1:
        return repr(next(iter(counts)))
    shown = [f"{name!r} ({count})" for name, count in list(counts.items())[:MOST_NAMES]]
    more = len(counts) - MOST_NAMES
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")


def _seconds(seconds: float) -> str:
    if seconds < 0.9995:
        return f"{1000 * seconds:.0f} ms"
    if seconds < 600:
        return f"{seconds:.1f} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    days = seconds / 86400
    return f"{seconds / 3600:.1f} h" if days < 2 else f"{days:.0f} days"


def _item(text: str) -> Iterator[str]:
    yield from _wrapped(text, "  ", "    ")


def _wrapped(text: str, first: str = "", following: str = "  ") -> list[str]:
    return textwrap.wrap(
        text, COLUMNS, initial_indent=first, subsequent_indent=following, break_long_words=False, break_on_hyphens=False
    )
