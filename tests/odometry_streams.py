"""Odometry messages with every fault that is dropped or corrected."""

from collections.abc import Sequence
from dataclasses import replace

from hypothesis import strategies as st

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, Odometry

STEP = Pose2(0.05, 0.0, 0.02)
PERIOD_NS = SECOND_NS // 10
FAULTS = ("sound",) * 6 + ("nan", "far", "duplicate", "back", "ahead", "clock_set_back", "leap", "restart")
FAULT_LISTS = st.lists(st.sampled_from(FAULTS), min_size=1, max_size=80)


def stream(faults: Sequence[str]) -> list[Odometry]:
    """A robot on a circle, one message for each fault; a clock that is set back and a leap last."""
    out, T, clock_ns = [], Pose2(1.0, 2.0, 0.5), 1_700_000_000 * SECOND_NS
    for fault in faults:
        clock_ns += PERIOD_NS
        T = T @ STEP
        if fault == "clock_set_back":
            clock_ns -= 100 * SECOND_NS
        if fault == "leap":
            T = Pose2(T.x + 30.0, T.y, T.theta)
        if fault == "restart":
            T = Pose2()
        out.append(_spoilt(Odometry(clock_ns, T), fault, out))
    return out


def _spoilt(m: Odometry, fault: str, before: list[Odometry]) -> Odometry:
    match fault:
        case "nan":
            return replace(m, pose=Pose2(float("nan"), 0.0, 0.0))
        case "far":
            return replace(m, pose=Pose2(1e12, 0.0, 0.0))
        case "duplicate" if before:
            return replace(m, stamp_ns=before[-1].stamp_ns)
        case "back":
            return replace(m, stamp_ns=m.stamp_ns - 3 * PERIOD_NS)
        case "ahead":
            return replace(m, stamp_ns=m.stamp_ns + 10**6 * SECOND_NS)
        case _:
            return m
