"""The keys, attachments and liveliness tokens by which rmw_zenoh puts ROS 2 on Zenoh.

Source: rmw_zenoh_cpp's `liveliness_utils.cpp` and `attachment_helpers.cpp`, since its release 0.2.4. A key of
zenoh-bridge-ros2dds is just the topic's name below the bridge's namespace.
"""

import hashlib
import struct
from dataclasses import dataclass

from wayfi.recordings.ros.messages import TYPESTORE

NODE = "wayfi"
GID_BYTES = 16


@dataclass(frozen=True, slots=True)
class RosTopic:
    """A topic that is published; its name has no slash in front.

    `depth` is that of its history; where it is `latched` (transient local), late subscribers get as many messages.
    """

    name: str
    type_name: str
    depth: int
    latched: bool = False


def rmw_key(domain: int, topic: str, type_name: str) -> str:
    """The key of `topic`, a name without a slash at either end, in a ROS domain."""
    return f"{domain}/{topic}/{_typed(type_name)}"


def rmw_key_expression(topic: str, type_name: str) -> str:
    """The keys of `topic` with messages of this type, in any domain and of any version of the type."""
    return f"*/{topic}/{_dds_type(type_name)}/*"


def attachment(sequence: int, stamp_ns: int, gid: bytes) -> bytes:
    """The attachment of a message: its number, when it was put, and the 16 bytes that identify its publisher."""
    return struct.pack(f"<qqB{GID_BYTES}s", sequence, stamp_ns, GID_BYTES, gid)


def gid_of(token: str) -> bytes:
    """The 16 bytes that identify the publisher of this token.

    rmw_zenoh hashes the token with XXH3; of other publishers it only expects that they are unique.
    """
    return hashlib.blake2b(token.encode(), digest_size=GID_BYTES).digest()


def node_token(domain: int, session_id: str, namespace: str) -> str:
    """The liveliness token by which ROS 2 sees wayfi as a node in `namespace`, "" for none."""
    return _token(domain, session_id, 0, "NN", namespace)


def publisher_token(domain: int, session_id: str, number: int, namespace: str, topic: RosTopic) -> str:
    """The liveliness token of the node's publisher of `topic` in `namespace`; each has its own `number` above 0."""
    name = f"/{namespace}/{topic.name}" if namespace else f"/{topic.name}"
    entity = _token(domain, session_id, number, "MP", namespace)
    return f"{entity}/{_mangled(name)}/{_typed(topic.type_name)}/{_qos(topic)}"


def _token(domain: int, session_id: str, number: int, kind: str, namespace: str) -> str:
    return f"@ros2_lv/{domain}/{session_id}/0/{number}/{kind}/%/{_mangled('/' + namespace)}/{NODE}"


def _mangled(name: str) -> str:
    return name.replace("/", "%")


def _qos(topic: RosTopic) -> str:
    """Reliability, durability, history and depth, deadline, lifespan, liveliness; empty where it is the default."""
    return f":{'1' if topic.latched else ''}:,{topic.depth}:,:,:,,"


def _typed(type_name: str) -> str:
    return f"{_dds_type(type_name)}/{TYPESTORE.hash_rihs01(type_name)}"


def _dds_type(type_name: str) -> str:
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"
