"""What ROS 2 peers receive over Zenoh: poses, transforms and maps in their conventions."""

import time
from typing import Any

import numpy as np
import pytest
import zenoh
from live.loopback import eventually, free_port
from zenoh.ext import (
    HistoryConfig,
    Int64,
    RecoveryConfig,
    declare_advanced_subscriber,
    z_deserialize,
)

from wayfi.backend.graph.health import State
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import GridRedrawn, PosePublished
from wayfi.frontends.frames.frames_config import FramesConfig
from wayfi.frontends.measurements import SECOND_NS, Sensor, StaticTransforms
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.messages import DIAGNOSTIC_ARRAY, OCCUPANCY_GRID, POSE_WITH_COVARIANCE, TF_MESSAGE, TYPESTORE
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import ConfigError, ZenohConfig, load_config
from wayfi.service.transport.output_messages import ERROR, Status, map_message
from wayfi.service.transport.publishers import Publishers
from wayfi.service.transport.zenoh_session import key_of, open_guest_session, open_session

AHEAD_NS = round(ZenohConfig().tf_ahead_s * SECOND_NS)
GRID = GridRedrawn(7 * SECOND_NS, np.array([[0.1, 0.5, 0.9]], np.float32), 0.05, (-1.0, 2.0))


def pose_event(number: int) -> PosePublished:
    T = Pose2(1.0 + number, 2.0, 0.5)
    return PosePublished((number + 1) * SECOND_NS, T, Pose2(0.0, 0.0, 0.0), T, np.eye(3), State.TRACKING)


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
    attachments = [*poses.attachments, *transforms.attachments, *maps.attachments]
    assert all(before_ns <= stamp_ns <= time.time_ns() for _, stamp_ns, _ in attachments)
    assert len({gid for _, _, gid in attachments}) == 3
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
        assert read.stamp_ns == (number + 1) * SECOND_NS + AHEAD_NS
        assert [(t.frame_id, t.child_frame_id) for t in read.transforms] == [("map", "odom")]
    message = TYPESTORE.deserialize_cdr(grid, OCCUPANCY_GRID)
    assert message.data.tolist() == [0, -1, 100]


def _ros_tokens(peer: zenoh.Session, domain: int) -> set[str]:
    replies = peer.liveliness().get(f"@ros2_lv/{domain}/**", timeout=5.0)
    return {str(reply.ok.key_expr) for reply in replies if reply.ok}


def test_an_rmw_peer_sees_a_node_with_its_publishers_as_long_as_they_are_there() -> None:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"], prefix="bot7", ros="rmw")
    with open_session(config) as session, open_guest_session(config) as peer:
        with Publishers(session, config):
            eventually(lambda: len(_ros_tokens(peer, 0)) == 6)
            tokens = [token.split("/") for token in _ros_tokens(peer, 0)]
            assert {token[2] for token in tokens} == {str(session.info.zid())}
            assert {(token[7], token[8]) for token in tokens} == {("%bot7", "wayfi")}
            named = {token[9]: token[12] for token in tokens if token[5] == "MP"}
        eventually(lambda: not _ros_tokens(peer, 0))
    assert named == {
        "%bot7%wayfi%pose": "::,10:,:,:,,",
        "%bot7%tf": "::,100:,:,:,,",
        "%bot7%map": ":1:,1:,:,:,,",
        "%bot7%amcl_pose": ":1:,1:,:,:,,",
        "%bot7%diagnostics": "::,10:,:,:,,",
    }


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


@pytest.mark.parametrize("ros", ["bridge", "rmw"])
def test_nav2_gets_what_it_has_of_amcl_in_the_frames_that_are_set(ros: str) -> None:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"], prefix="bot7", ros=ros, tf_ahead_s=1.0)  # type: ignore[arg-type]
    frames = FramesConfig(map="hall", odom="bot7/odom", base_link="bot7/base_link")
    types = {"tf": TF_MESSAGE, "amcl_pose": POSE_WITH_COVARIANCE, "diagnostics": DIAGNOSTIC_ARRAY}
    keys = {n: key_of(config, n) if ros == "bridge" else rmw_key_in(0, f"bot7/{n}", t) for n, t in types.items()}
    heard, late, own = {name: Heard() for name in types}, Heard(), Heard()
    with open_session(config) as session, open_guest_session(config) as peer:
        for name, key in keys.items():
            peer.declare_subscriber(key, heard[name])
        peer.declare_subscriber("bot7/wayfi/tf", own)
        with Publishers(session, config, frames) as publishers:
            eventually(lambda: _publish_all(publishers) or (own.samples and all(of.samples for of in heard.values())))
            with open_guest_session(config) as newcomer:
                joined = listen_as_transient_local(newcomer, keys["amcl_pose"], late)
                eventually(lambda: late.samples)
                joined.undeclare()
    pose = TYPESTORE.deserialize_cdr(late.samples[0][0], POSE_WITH_COVARIANCE)
    assert (pose.header.frame_id, pose.header.stamp.sec) == ("hall", 1)
    ahead, at_once = (decode(of.samples[0][0], Sensor.TF_STATIC, Encoding.CDR) for of in (heard["tf"], own))
    assert isinstance(ahead, StaticTransforms)
    assert [(t.frame_id, t.child_frame_id) for t in ahead.transforms] == [("hall", "bot7/odom")]
    assert (ahead.stamp_ns, at_once.stamp_ns) == (2 * SECOND_NS, SECOND_NS)
    (status,) = TYPESTORE.deserialize_cdr(heard["diagnostics"].samples[0][0], DIAGNOSTIC_ARRAY).status
    assert (status.name, status.message) == ("wayfi", "LOST: no odometry")


def _publish_all(publishers: Publishers) -> None:
    publishers.publish_pose(pose_event(0))
    publishers.publish_status(SECOND_NS, Status(ERROR, "LOST: no odometry", {"state": "LOST"}))


@pytest.mark.parametrize("setting", ["zenoh.ros=dds", "zenoh.ros=1", "zenoh.ros_domain=-1", "zenoh.ros_domain=233"])
def test_an_unknown_convention_or_domain_is_refused(setting: str) -> None:
    with pytest.raises(ConfigError, match=setting.split("=")[0].replace(".", r"\.")):
        load_config(settings=[setting])
