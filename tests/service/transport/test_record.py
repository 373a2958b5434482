"""`wayfi record`."""

import signal
import subprocess
from pathlib import Path

from live.daemons import odometry
from live.loopback import CLI, LONG_S, eventually, free_port

from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.messages import (
    ODOMETRY,
)
from wayfi.service.config import Config, ZenohConfig
from wayfi.service.replay.publish import has_subscriber, publish_recording
from wayfi.service.transport.zenoh_session import open_session


def test_what_is_recorded_is_what_was_published(tmp_path: Path) -> None:
    recording, out = tmp_path / "in.mcap", tmp_path / "out.mcap"
    with McapWriter(recording) as writer:
        for number in range(50):
            writer.write("/odom", ODOMETRY, "cdr", number * 100_000_000, odometry(number))
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"])
    settings = ["--set", f"zenoh.listen={config.listen}"]
    with (
        open_session(config) as session,
        subprocess.Popen([*CLI, "record", "--out", str(out), "--quiet", *settings]) as recorder,
    ):
        publisher = session.declare_publisher("odom")
        eventually(lambda: has_subscriber(publisher))
        summary = publish_recording(recording, Config(zenoh=config), None)
        recorder.send_signal(signal.SIGINT)
        assert recorder.wait(timeout=LONG_S) == 0
    assert summary.messages == {"/odom": 50}
    assert [(r.topic, r.data) for r in open_recording(out)] == [(r.topic, r.data) for r in open_recording(recording)]
