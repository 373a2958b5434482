"""A trial: the first minute of a recording through the pipeline, to hear what a replay would say of it."""

from dataclasses import dataclass

from wayfi.frontends.calibration import Calibration
from wayfi.frontends.intake.stand_ins import TRANSFORMS_LEAD, WHEELS_LEAD
from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.log import NullLog
from wayfi.recordings.mcap.recording import Recording
from wayfi.service.config import Config
from wayfi.service.drive.unused_streams import OF_READINGS
from wayfi.service.drive.warm_up import warm_up
from wayfi.service.process.stop_signal import StopSignal
from wayfi.service.replay.found_topics import with_found_topics
from wayfi.service.replay.replay import replayer_of

TRIAL_S = 60.0  # of poses: streams are seen to be used or not within seconds, clocks within half a minute
MOST_MESSAGES = 20_000  # where no pose comes: a minute of fast sensors


@dataclass(frozen=True, slots=True)
class Trial:
    """The first `seconds` as replayed: `poses`, what was warned of, and messages and drops (by reason) by topic."""

    seconds: float
    poses: int
    warnings: tuple[str, ...]
    messages: dict[str, int]
    dropped: dict[str, dict[str, int]]

    @property
    def led_by_transforms(self) -> bool:
        """Whether the odometry was taken from /tf, and no message of its own came."""
        began, ended = (any(text.startswith(said) for text in self.warnings) for said in (TRANSFORMS_LEAD, WHEELS_LEAD))
        return began and not ended

    def used(self, topic: str) -> float:
        """The share of a topic's messages that was used, 0 to 1."""
        count = self.messages.get(topic, 0)
        lost = sum(n for reason, n in self.dropped.get(topic, {}).items() if reason not in OF_READINGS)
        return max(0.0, 1.0 - lost / count) if count else 0.0


def try_out(recording: Recording, config: Config, calibration: Calibration | None) -> Trial:
    """Replay the beginning of a recording. Raises RecordingError."""
    config, _ = with_found_topics(config, recording)
    replayer = replayer_of(recording, config, calibration, NullLog())
    start_ns = 0
    with StopSignal() as stop:
        warm_up()
        for record in recording:
            if stop.requested:
                raise KeyboardInterrupt
            replayer.play(record)
            now_ns = replayer.drive.pipeline.stamp_ns
            start_ns = start_ns or now_ns
            if now_ns - start_ns > TRIAL_S * SECOND_NS or replayer.drive.counters.messages.total() > MOST_MESSAGES:
                break
        drive = replayer.drive
        result = drive.finish()
    seconds = (int(result.stamps_ns[-1]) - int(result.stamps_ns[0])) / SECOND_NS if len(result.stamps_ns) else 0.0
    counters = drive.counters
    dropped = {topic: dict(reasons) for topic, reasons in counters.dropped.items()}
    return Trial(seconds, len(result.stamps_ns), tuple(counters.warnings), dict(counters.messages), dropped)
