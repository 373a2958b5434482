"""ROS 2 peers as they speak over Zenoh, on loopback: what they put is taken, and they can use what is put."""

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
import zenoh
from zenoh.ext import (
    CacheConfig,
    HistoryConfig,
    Int64,
    RecoveryConfig,
    declare_advanced_publisher,
    declare_advanced_subscriber,
    z_deserialize,
    z_serialize,
)

from wayfi.backend.graph.health import State
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import GridRedrawn, PosePublished
from wayfi.frontends.measurements import Odometry, Sensor, StaticTransform, StaticTransforms
from wayfi.recordings.ros.codec import decode, encode
from wayfi.recordings.ros.messages import NS_PER_S, OCCUPANCY_GRID, POSE_WITH_COVARIANCE, TF_MESSAGE, TYPESTORE
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import ConfigError, RecordingConfig, ZenohConfig, load_config
from wayfi.service.transport.output_messages import map_message
from wayfi.service.transport.publishers import Publishers
from wayfi.service.transport.queues import Queues, limits_of
from wayfi.service.transport.subscribers import SYNC, Subscribers
from wayfi.service.transport.zenoh_session import key_of, open_guest_session, open_session

ODOM_TYPE = "nav_msgs::msg::dds_::Odometry_"
TF_TYPE = "tf2_msgs::msg::dds_::TFMessage_"
HASH = "RIHS01_" + "0123456789abcdef" * 4  # of some other release of ROS
GID = bytes(range(16))


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def eventually(condition: Callable[[], Any]) -> None:
    deadline_s = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < deadline_s, "it never came to be"
        time.sleep(0.02)


def rmw_attachment(number: int) -> zenoh.ZBytes:
    return z_serialize((Int64(number), Int64(time.time_ns()), GID))


# In


class Listening:
    """Subscribers as the daemon has them, and a session of a ROS 2 peer beside them."""

    def __init__(self, config: ZenohConfig, queues: Queues, peer: zenoh.Session) -> None:
        self.config = config
        self.queues = queues
        self.peer = peer

    def put(self, key: str, data: bytes, **more: Any) -> None:  # noqa: ANN401 - as zenoh's put
        self.peer.put(key, data, congestion_control=zenoh.CongestionControl.BLOCK, **more)

    def taken(self) -> list[tuple[Sensor, Encoding, bytes]]:
        """All that was put until now and not taken yet."""
        replies = list(self.peer.get(key_of(self.config, SYNC), timeout=10.0))
        assert all(reply.ok for reply in replies)
        assert replies
        found = []
        while received := self.queues.take(0.0):
            found.append((received.sensor, received.encoding, received.data))
        return found


@contextmanager
def listening(prefix: str) -> Iterator[Listening]:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"], prefix=prefix)
    queues = Queues(limits_of(config))
    with (
        open_session(config) as session,
        Subscribers(session, config, RecordingConfig().topics, queues),
        open_guest_session(config) as peer,
    ):
        yield Listening(config, queues, peer)


@pytest.fixture(params=["", "bot7", "fleet/bot7"])
def daemon(request: pytest.FixtureRequest) -> Iterator[Listening]:
    with listening(request.param) as opened:
        yield opened


def odometry(number: int, encoding: Encoding = Encoding.CDR) -> bytes:
    return encode(Odometry((number + 1) * NS_PER_S // 10, Pose2(0.1 * number, 0.0, 0.0)), encoding)


def mount(child: str) -> bytes:
    return encode(StaticTransforms(0, (StaticTransform("base_link", child, (0.1, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0)),)))


def test_each_message_of_an_rmw_publisher_comes_once_and_in_order(daemon: Listening) -> None:
    odom = key_of(daemon.config, "odom")
    publisher = daemon.peer.declare_publisher(
        f"0/{odom}/{ODOM_TYPE}/{HASH}", congestion_control=zenoh.CongestionControl.BLOCK
    )
    for number in range(50):
        publisher.put(odometry(number), attachment=rmw_attachment(number + 1))
    assert daemon.taken() == [(Sensor.ODOM, Encoding.CDR, odometry(n)) for n in range(50)]


def test_the_bridges_keys_and_rmws_of_any_domain_come_once_each(daemon: Listening) -> None:
    odom = key_of(daemon.config, "odom")
    daemon.put(odom, odometry(0))
    daemon.put(f"0/{odom}/{ODOM_TYPE}/{HASH}", odometry(1), attachment=rmw_attachment(1))
    daemon.put(f"42/{odom}/{ODOM_TYPE}/TypeHashNotSupported", odometry(2))
    daemon.put(odom, odometry(3, Encoding.JSON), encoding=zenoh.Encoding.APPLICATION_JSON)
    assert [data for _, _, data in daemon.taken()] == [*map(odometry, range(3)), odometry(3, Encoding.JSON)]


def test_what_is_anothers_or_of_another_type_is_not_taken(daemon: Listening) -> None:
    odom = key_of(daemon.config, "odom")
    for key in (
        f"0/{odom}/{TF_TYPE}/{HASH}",
        f"0/{odom}/{ODOM_TYPE}",
        f"0/bot8/{odom}/{ODOM_TYPE}/{HASH}",
        f"0/{odom}/wheels/{ODOM_TYPE}/{HASH}",
        f"bot8/{odom}",
    ):
        daemon.put(key, odometry(0), attachment=rmw_attachment(1))
    assert daemon.taken() == []


@pytest.mark.parametrize("garbage", [b"", b"\xff", bytes(33), b"\x00" * 16 + b"\xff" * 17, bytes(1 << 20)])
def test_a_malformed_attachment_does_no_harm(garbage: bytes) -> None:
    with listening("") as daemon:
        daemon.put(f"0/odom/{ODOM_TYPE}/{HASH}", odometry(0), attachment=garbage)
        daemon.put("odom", odometry(1), attachment=garbage)
        assert [data for _, _, data in daemon.taken()] == [odometry(0), odometry(1)]


@pytest.mark.parametrize("key", ["tf_static", f"0/tf_static/{TF_TYPE}/{HASH}"])
def test_static_transforms_said_before_are_asked_for_and_come_once(key: str) -> None:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"])
    queues = Queues(limits_of(config))
    with open_session(config) as session, open_guest_session(config) as one, open_guest_session(config) as two:
        early = [_latched(peer, key) for peer in (one, two)]
        for number, publisher in enumerate(early):
            publisher.put(mount(f"laser{number}"), attachment=rmw_attachment(1))
        with Subscribers(session, config, RecordingConfig().topics, queues):
            eventually(lambda: queues.depths()[Sensor.TF_STATIC] >= 2)
            early[0].put(mount("laser2"), attachment=rmw_attachment(2))
            eventually(lambda: queues.depths()[Sensor.TF_STATIC] >= 3)
            time.sleep(0.3)  # in which a second copy would come
    found = []
    while received := queues.take(0.0):
        found.append(received.data)
    assert sorted(found) == sorted(map(mount, ("laser0", "laser1", "laser2")))
    assert found[-1] == mount("laser2")


def _latched(peer: zenoh.Session, key: str) -> Any:  # noqa: ANN401 - zenoh's advanced publisher
    return declare_advanced_publisher(peer, key, cache=CacheConfig(max_samples=1), publisher_detection=True)


# Out


def pose_event(number: int) -> PosePublished:
    T = Pose2(1.0 + number, 2.0, 0.5)
    return PosePublished((number + 1) * NS_PER_S, T, Pose2(0.0, 0.0, 0.0), T, np.eye(3), State.TRACKING)


GRID = GridRedrawn(7 * NS_PER_S, np.array([[0.1, 0.5, 0.9]], np.float32), 0.05, (-1.0, 2.0))


class Heard:
    """What a ROS 2 peer hears of a topic."""

    def __init__(self) -> None:
        self.samples: list[tuple[bytes, bytes]] = []

    def __call__(self, sample: zenoh.Sample) -> None:
        given = sample.attachment
        self.samples.append((sample.payload.to_bytes(), given.to_bytes() if given else b""))

    @property
    def attachments(self) -> list[tuple[int, int, bytes]]:
        return [z_deserialize(tuple[Int64, Int64, bytes], zenoh.ZBytes(given)) for _, given in self.samples]


def rmw_key_in(domain: int, name: str, type_name: str) -> str:
    package, _, kind = type_name.split("/")
    return f"{domain}/{name}/{package}::msg::dds_::{kind}_/{TYPESTORE.hash_rihs01(type_name)}"


def listen_as_transient_local(peer: zenoh.Session, key: str, heard: Heard) -> Any:  # noqa: ANN401 - as rmw_zenoh does
    history = HistoryConfig(detect_late_publishers=True, max_samples=1)
    recovery = RecoveryConfig(periodic_queries=None, heartbeat=True)
    return declare_advanced_subscriber(peer, key, heard, history=history, recovery=recovery, subscriber_detection=True)


@pytest.mark.parametrize("prefix", ["", "bot7"])
def test_an_rmw_peer_gets_poses_transforms_and_maps(prefix: str) -> None:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"], prefix=prefix, ros="rmw", ros_domain=5)
    poses, transforms, maps, late = Heard(), Heard(), Heard(), Heard()
    before_ns = time.time_ns()
    with open_session(config) as session, open_guest_session(config) as peer:
        peer.declare_subscriber(rmw_key_in(5, key_of(config, "wayfi/pose"), POSE_WITH_COVARIANCE), poses)
        peer.declare_subscriber(rmw_key_in(5, key_of(config, "tf"), TF_MESSAGE), transforms)
        map_key = rmw_key_in(5, key_of(config, "map"), OCCUPANCY_GRID)
        there = listen_as_transient_local(peer, map_key, maps)
        with Publishers(session, config) as publishers:
            eventually(lambda: _ros_tokens(peer, 5))
            for number in range(10):
                publishers.publish_pose(pose_event(number))
            publishers.publish_map(map_message(GRID, MapConfig()))
            eventually(lambda: len(poses.samples) == len(transforms.samples) == 10 and maps.samples)
            with open_guest_session(config) as newcomer:
                joined = listen_as_transient_local(newcomer, map_key, late)
                eventually(lambda: late.samples)
                joined.undeclare()
            there.undeclare()
    assert [n for n, _, _ in poses.attachments] == [n for n, _, _ in transforms.attachments] == list(range(1, 11))
    said = [*poses.attachments, *transforms.attachments, *maps.attachments]
    assert all(before_ns <= stamp_ns <= time.time_ns() for _, stamp_ns, _ in said)
    assert len({gid for _, _, gid in said}) == 3
    assert late.samples == maps.samples
    _check_messages([data for data, _ in poses.samples], [data for data, _ in transforms.samples], maps.samples[0][0])


def _check_messages(poses: list[bytes], transforms: list[bytes], grid: bytes) -> None:
    for number, data in enumerate(poses):
        message: Any = TYPESTORE.deserialize_cdr(data, POSE_WITH_COVARIANCE)
        assert (message.header.frame_id, message.header.stamp.sec) == ("map", number + 1)
        assert message.pose.pose.position.x == 1.0 + number
    for number, data in enumerate(transforms):
        read = decode(data, Sensor.TF_STATIC, Encoding.CDR)
        assert isinstance(read, StaticTransforms)
        assert read.stamp_ns == (number + 1) * NS_PER_S
        assert [(t.frame_id, t.child_frame_id) for t in read.transforms] == [("map", "odom")]
    message = TYPESTORE.deserialize_cdr(grid, OCCUPANCY_GRID)
    assert message.data.tolist() == [0, -1, 100]


def _ros_tokens(peer: zenoh.Session, domain: int) -> set[str]:
    replies = peer.liveliness().get(f"@ros2_lv/{domain}/**", timeout=5.0)
    return {str(reply.ok.key_expr) for reply in replies if reply.ok}


def test_an_rmw_peer_sees_a_node_with_three_publishers_as_long_as_they_are_there() -> None:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"], prefix="bot7", ros="rmw")
    with open_session(config) as session, open_guest_session(config) as peer:
        with Publishers(session, config):
            eventually(lambda: len(_ros_tokens(peer, 0)) == 4)
            tokens = [token.split("/") for token in _ros_tokens(peer, 0)]
            assert {token[2] for token in tokens} == {str(session.info.zid())}
            assert {(token[7], token[8]) for token in tokens} == {("%bot7", "wayfi")}
            named = {token[9]: token[12] for token in tokens if token[5] == "MP"}
        eventually(lambda: not _ros_tokens(peer, 0))
    assert named == {"%bot7%wayfi%pose": "::,10:,:,:,,", "%bot7%tf": "::,100:,:,:,,", "%bot7%map": ":1:,1:,:,:,,"}


@pytest.mark.parametrize("prefix", ["", "bot7"])
def test_the_bridge_gets_each_message_once_below_its_namespace(prefix: str) -> None:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"], prefix=prefix, ros="bridge")
    heard = {name: Heard() for name in ("wayfi/pose", "tf", "map")}
    with open_session(config) as session, Publishers(session, config) as publishers:
        publishers.publish_map(map_message(GRID, MapConfig()))
        with open_guest_session(config) as peer:
            for name in ("wayfi/pose", "tf"):
                peer.declare_subscriber(key_of(config, name), heard[name])
            late = listen_as_transient_local(peer, key_of(config, "map"), heard["map"])
            eventually(lambda: heard["map"].samples)
            for number in range(10):
                publishers.publish_pose(pose_event(number))
            eventually(lambda: len(heard["wayfi/pose"].samples) >= 10 and len(heard["tf"].samples) >= 10)
            late.undeclare()
    messages = {name: [data for data, _ in of.samples] for name, of in heard.items()}
    _check_messages(messages["wayfi/pose"], messages["tf"], messages["map"][0])
    assert {name: len(data) for name, data in messages.items()} == {"wayfi/pose": 10, "tf": 10, "map": 1}


def test_without_ros_nothing_is_put_for_it() -> None:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"])
    keys: set[str] = set()
    with open_session(config) as session, open_guest_session(config) as peer:
        peer.declare_subscriber("**", lambda sample: keys.add(str(sample.key_expr)))
        with Publishers(session, config) as publishers:
            while len(keys) < 3:
                publishers.publish_pose(pose_event(0))
                publishers.publish_map(map_message(GRID, MapConfig()))
                time.sleep(0.02)
            time.sleep(0.3)  # in which others would come
            assert not _ros_tokens(peer, 0)
    assert keys == {"wayfi/pose", "wayfi/tf", "wayfi/map"}


@pytest.mark.parametrize("setting", ["zenoh.ros=dds", "zenoh.ros=1", "zenoh.ros_domain=-1", "zenoh.ros_domain=233"])
def test_a_convention_or_domain_that_ros_has_not_is_refused(setting: str) -> None:
    with pytest.raises(ConfigError, match=setting.split("=")[0].replace(".", r"\.")):
        load_config(settings=[setting])
