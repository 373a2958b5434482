"""What ROS 2 peers put on Zenoh is received once and in order."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import zenoh
from live.loopback import LONG_S, eventually, free_port
from zenoh.ext import (
    CacheConfig,
    Int64,
    declare_advanced_publisher,
    z_serialize,
)

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, InitialPose, Odometry, PoseFix, Sensor, StaticTransforms, Transform
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import RecordingConfig, ZenohConfig
from wayfi.service.transport.message_queue import MessageQueue, Received, limits_of
from wayfi.service.transport.subscribers import SYNC, Subscribers
from wayfi.service.transport.zenoh_session import key_of, open_guest_session, open_session

ODOM_TYPE = "nav_msgs::msg::dds_::Odometry_"
POSE_TYPE = "geometry_msgs::msg::dds_::PoseWithCovarianceStamped_"
TF_TYPE = "tf2_msgs::msg::dds_::TFMessage_"
HASH = "RIHS01_" + "0123456789abcdef" * 4  # of some other release of ROS
GID = bytes(range(16))


def rmw_attachment(number: int) -> zenoh.ZBytes:
    return z_serialize((Int64(number), Int64(time.time_ns()), GID))


class Listening:
    """Subscribers as the daemon has them, and a session of a ROS 2 peer beside them."""

    def __init__(self, config: ZenohConfig, inbox: MessageQueue[Received], peer: zenoh.Session) -> None:
        self.config = config
        self.inbox = inbox
        self.peer = peer

    def put(self, key: str, data: bytes, **more: Any) -> None:  # noqa: ANN401 - as zenoh's put
        self.peer.put(key, data, congestion_control=zenoh.CongestionControl.BLOCK, **more)

    def popped(self) -> list[tuple[Sensor, Encoding, bytes]]:
        """All that was put until now and not popped yet."""
        replies = list(self.peer.get(key_of(self.config, SYNC), timeout=LONG_S))
        assert all(reply.ok for reply in replies)
        assert replies
        found = []
        while received := self.inbox.pop(0.0):
            found.append((received.sensor, received.encoding, received.data))
        return found


@contextmanager
def listening(prefix: str, topics: RecordingConfig = RecordingConfig()) -> Iterator[Listening]:  # noqa: B008 - frozen
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"], prefix=prefix)
    inbox = MessageQueue[Received](limits_of(config, topics.every_topic))
    with (
        open_session(config) as session,
        Subscribers(session, config, topics.every_topic, inbox),
        open_guest_session(config) as peer,
    ):
        yield Listening(config, inbox, peer)


@pytest.fixture(params=["", "bot7", "fleet/bot7"])
def daemon(request: pytest.FixtureRequest) -> Iterator[Listening]:
    with listening(request.param) as opened:
        yield opened


def odometry(number: int, encoding: Encoding = Encoding.CDR) -> bytes:
    return encode(Odometry((number + 1) * SECOND_NS // 10, Pose2(0.1 * number, 0.0, 0.0)), encoding)


def mount(child: str) -> bytes:
    return encode(StaticTransforms(0, (Transform("base_link", child, (0.1, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0)),)))


def test_each_message_of_an_rmw_publisher_comes_once_and_in_order(daemon: Listening) -> None:
    odom = key_of(daemon.config, "odom")
    publisher = daemon.peer.declare_publisher(
        f"0/{odom}/{ODOM_TYPE}/{HASH}", congestion_control=zenoh.CongestionControl.BLOCK
    )
    for number in range(50):
        publisher.put(odometry(number), attachment=rmw_attachment(number + 1))
    assert daemon.popped() == [(Sensor.ODOM, Encoding.CDR, odometry(n)) for n in range(50)]


def test_the_bridges_keys_and_rmws_of_any_domain_come_once_each(daemon: Listening) -> None:
    odom = key_of(daemon.config, "odom")
    daemon.put(odom, odometry(0))
    daemon.put(f"0/{odom}/{ODOM_TYPE}/{HASH}", odometry(1), attachment=rmw_attachment(1))
    daemon.put(f"42/{odom}/{ODOM_TYPE}/TypeHashNotSupported", odometry(2))
    daemon.put(odom, odometry(3, Encoding.JSON), encoding=zenoh.Encoding.APPLICATION_JSON)
    assert [data for _, _, data in daemon.popped()] == [*map(odometry, range(3)), odometry(3, Encoding.JSON)]


def test_other_robots_topics_and_types_are_not_received(daemon: Listening) -> None:
    odom = key_of(daemon.config, "odom")
    for key in (
        f"0/{odom}/{TF_TYPE}/{HASH}",
        f"0/{odom}/{ODOM_TYPE}",
        f"0/bot8/{odom}/{ODOM_TYPE}/{HASH}",
        f"0/{odom}/wheels/{ODOM_TYPE}/{HASH}",
        f"bot8/{odom}",
    ):
        daemon.put(key, odometry(0), attachment=rmw_attachment(1))
    assert daemon.popped() == []


@pytest.mark.parametrize("garbage", [b"", b"\xff", bytes(33), b"\x00" * 16 + b"\xff" * 17, bytes(1 << 20)])
def test_a_malformed_attachment_does_no_harm(garbage: bytes) -> None:
    with listening("") as daemon:
        daemon.put(f"0/odom/{ODOM_TYPE}/{HASH}", odometry(0), attachment=garbage)
        daemon.put("odom", odometry(1), attachment=garbage)
        assert [data for _, _, data in daemon.popped()] == [odometry(0), odometry(1)]


@pytest.mark.parametrize("key", ["tf_static", f"0/tf_static/{TF_TYPE}/{HASH}"])
def test_static_transforms_put_before_are_requested_and_received_once(key: str) -> None:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"])
    inbox = MessageQueue[Received](limits_of(config, RecordingConfig().every_topic))
    with open_session(config) as session, open_guest_session(config) as one, open_guest_session(config) as two:
        early = [_latched(peer, key) for peer in (one, two)]
        for number, publisher in enumerate(early):
            publisher.put(mount(f"laser{number}"), attachment=rmw_attachment(1))
        with Subscribers(session, config, RecordingConfig().every_topic, inbox):
            eventually(lambda: inbox.depths()["/tf_static"] >= 2)
            early[0].put(mount("laser2"), attachment=rmw_attachment(2))
            eventually(lambda: inbox.depths()["/tf_static"] >= 3)
            time.sleep(0.3)  # in which a second copy would come
    found = []
    while received := inbox.pop(0.0):
        found.append(received.data)
    assert sorted(found) == sorted(map(mount, ("laser0", "laser1", "laser2")))
    assert found[-1] == mount("laser2")


@pytest.mark.parametrize("key", ["tf", f"0/tf/{TF_TYPE}/{HASH}"])
def test_transforms_are_received_but_for_the_sessions_own(key: str) -> None:
    config, topics = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"]), RecordingConfig().every_topic
    inbox = MessageQueue[Received](limits_of(config, topics))
    with (
        open_session(config) as session,
        Subscribers(session, config, topics, inbox),
        open_guest_session(config) as peer,
    ):
        session.put(key, mount("own"))
        Listening(config, inbox, peer).put(key, mount("laser"))
        assert Listening(config, inbox, peer).popped() == [(Sensor.TF, Encoding.CDR, mount("laser"))]


def _latched(peer: zenoh.Session, key: str) -> Any:  # noqa: ANN401 - zenoh's advanced publisher
    return declare_advanced_publisher(peer, key, cache=CacheConfig(max_samples=1), publisher_detection=True)


def test_all_of_several_topics_are_received_and_told_apart() -> None:
    with listening("bot7", RecordingConfig(scan=["/scan_front", "/scan_rear"])) as daemon:
        daemon.put("bot7/scan_rear", b"rear")
        daemon.put("bot7/scan_front", b"front")
        daemon.put("bot7/scan", b"neither")
        assert daemon.popped() == [(Sensor.SCAN, Encoding.CDR, b"rear"), (Sensor.SCAN, Encoding.CDR, b"front")]
        assert {t: n for t, n in daemon.inbox.received().items() if n} == {"/scan_front": 1, "/scan_rear": 1}


def test_initial_poses_come_on_our_key_and_on_those_of_ros_2(daemon: Listening) -> None:
    poses = [encode(InitialPose(number, Pose2(number, 0.0, 0.0))) for number in range(3)]
    ours, ros = (key_of(daemon.config, name) for name in ("wayfi/initialpose", "initialpose"))
    for key, data in zip((ours, ros, f"0/{ros}/{POSE_TYPE}/{HASH}"), poses, strict=True):
        daemon.put(key, data, attachment=rmw_attachment(1))
    assert daemon.popped() == [(Sensor.INITIAL_POSE, Encoding.CDR, data) for data in poses]


def test_fixes_are_told_apart_from_other_poses(daemon: Listening) -> None:
    fix = encode(PoseFix(1, Pose2()))
    for key in ("fix", "amcl_pose", "wayfi/pose"):
        daemon.put(key_of(daemon.config, key), fix)
    assert daemon.popped() == [(Sensor.FIX, Encoding.CDR, fix)]
