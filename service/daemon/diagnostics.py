"""The daemon's diagnostics: state, rates, queues, drops and latencies, for its status and its report."""

import math
import time
from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from wayfi.backend.graph.health import State
from wayfi.frontends.events import Event, FloorChanged, PosePublished, StateChanged, Warned
from wayfi.service.daemon.estimator_messages import Backlog
from wayfi.service.drive.counters import Drops, merged
from wayfi.service.drive.timing import StageCost
from wayfi.service.transport.message_queue import MessageQueue, Received
from wayfi.service.transport.output_messages import ERROR, OK, WARN, Status

LEVEL = {State.TRACKING: OK, State.UNCERTAIN: WARN, State.RELOCALISING: WARN, State.LOST: ERROR}
RECENT_POSES = 1000
PERIOD_S = 1.0
STALE_S = 1.5  # for so long a pose says where the robot is: most send ten poses a second, and drive 1 m/s


class Latencies:
    """Seconds from the receive callback of a message to the put of the pose that it gave, in bounded memory."""

    def __init__(self) -> None:
        self._all = StageCost()
        self._recent: deque[float] = deque(maxlen=RECENT_POSES)
        self._poses = 0

    def __len__(self) -> int:
        return self._poses

    def add(self, seconds: float) -> None:
        """Add one pose."""
        self._all.add(seconds)
        self._recent.append(seconds)
        self._poses += 1

    def summary(self) -> dict[str, float]:
        """p50, p99 and max in ms of all poses; empty before the first."""
        if not self._poses:
            return {}
        return {name: value for name, value in self._all.summary().items() if name in ("p50_ms", "p99_ms", "max_ms")}

    def recent(self) -> dict[str, float]:
        """The same of the last `RECENT_POSES`."""
        if not self._recent:
            return {}
        p50, p99, most = np.percentile(list(self._recent), [50, 99, 100]) * 1e3
        return {"p50_ms": round(float(p50), 3), "p99_ms": round(float(p99), 3), "max_ms": round(float(most), 3)}


class Diagnostics:
    """What the status reports; due once a second and whenever the state or a complaint has changed.

    `estimation_drops` is what the estimation has dropped, by topic and reason.
    """

    def __init__(self, inbox: MessageQueue[Received], backlog: Backlog) -> None:
        self._inbox = inbox
        self._backlog = backlog
        self._state = State.UNCERTAIN
        self._reason = "no odometry and no scan yet"
        self._published_s = math.inf
        self._floor: int | None = 0
        self._complaints: dict[str, str] = {}
        self._reported: tuple[State, list[str], float] | None = None
        self._received: tuple[float, dict[str, int]] = (time.monotonic(), {})
        self._rates: dict[str, float] = {}
        self.estimation_drops: Drops = {}
        self.latencies = Latencies()

    def handle(self, event: Event, received_s: float) -> None:
        """Note an event that was published just now, whose message was received at `received_s`, monotonic."""
        match event:
            case PosePublished():
                if self._state is not event.state or not len(self.latencies):
                    self._state, self._reason = event.state, ""
                self._published_s = time.monotonic()
                self.latencies.add(self._published_s - received_s)
            case StateChanged():
                self._state, self._reason = event.state, event.reason
            case FloorChanged():
                self._floor = event.floor
            case Warned() if event.ends:
                self._complaints.pop(event.complaint, None)
            case Warned() if event.complaint:
                self._complaints[event.complaint] = event.text

    def due(self) -> bool:
        """Whether the status has to be reported now."""
        if self._reported is None:
            return True
        state, complaints, reported_s = self._reported
        changed = state is not self._judged()[0] or complaints != list(self._complaints)
        return changed or time.monotonic() - reported_s >= PERIOD_S

    def queue_drops(self) -> Drops:
        """Messages that did not reach the estimation, by topic and reason."""
        return merged(self._inbox.dropped(), self._backlog.dropped())

    def dropped(self) -> Drops:
        """All messages dropped so far, by topic and reason."""
        return merged(self.estimation_drops, self.queue_drops())

    def status(self, extra: Mapping[str, object]) -> Status:
        """The status as of now, with the values of `extra`."""
        judged, reason = self._judged()
        self._reported = (judged, list(self._complaints), time.monotonic())
        values: dict[str, Any] = {"state": judged.value, "reason": reason, **extra}
        values["floor"] = "unknown" if self._floor is None else self._floor
        values |= {f"rate_hz.{topic}": f"{hz:.1f}" for topic, hz in self._measured_rates().items()}
        fed = self._backlog.depths()
        values |= {f"queue.{topic}": depth + fed[topic] for topic, depth in self._inbox.depths().items()}
        values |= {f"dropped.{topic}.{why}": n for topic, whys in self.dropped().items() for why, n in whys.items()}
        values |= {f"complaint.{name}": text for name, text in self._complaints.items()}
        values |= {"poses": len(self.latencies)}
        values |= {f"latency.{name}": value for name, value in self.latencies.recent().items()}
        state = f"{judged.value}: {reason}" if reason else judged.value
        level = max(LEVEL[judged], WARN) if self._complaints else LEVEL[judged]
        message = "; ".join([state, *self._complaints.values()])
        return Status(level, message, {key: str(value) for key, value in values.items()})

    def _judged(self) -> tuple[State, str]:
        """The state as of now, and its reason: no sensor tells where a robot is that was TRACKING some time ago."""
        since_s = time.monotonic() - self._published_s
        if self._state is State.TRACKING and since_s > STALE_S:
            return State.UNCERTAIN, f"no pose for {since_s:.1f} s: what the robot has driven since is not known"
        return self._state, self._reason

    def _measured_rates(self) -> dict[str, float]:
        """Messages a second since they were last measured, at least half a period ago."""
        now_s, (since_s, before) = time.monotonic(), self._received
        if now_s - since_s >= PERIOD_S / 2 or not self._rates:
            received = self._inbox.received()
            seconds = max(now_s - since_s, 1e-3)
            self._rates = {topic: (n - before.get(topic, 0)) / seconds for topic, n in received.items()}
            self._received = (now_s, received)
        return self._rates
