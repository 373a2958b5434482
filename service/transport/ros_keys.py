"""How ROS 2 names things on Zenoh: the keys, the attachments and the liveliness tokens of rmw_zenoh.

After rmw_zenoh_cpp's `liveliness_utils.cpp` and `attachment_helpers.cpp`, as they are since its release 0.2.4. The keys
of zenoh-bridge-ros2dds need nothing of this: a topic's name below the bridge's namespace.
"""

import hashlib
import struct
from dataclasses import dataclass

from wayfi.recordings.ros.messages import TYPESTORE

NODE = "wayfi"
GID_BYTES = 16


@dataclass(frozen=True, slots=True)
class RosTopic:
    """A topic that is published, by its name without a slash in front.

    `depth` messages wait for a slow subscriber; where it is `kept`, as many are there for a late one (transient local).
    """

    name: str
    type_name: str
    depth: int
    kept: bool = False


def rmw_key(domain: int, topic: str, type_name: str) -> str:
    """The key of `topic`, a name without a slash at either end, in a ROS domain."""
    return f"{domain}/{topic}/{_typed(type_name)}"


def rmw_key_expression(topic: str, type_name: str) -> str:
    """The keys of `topic` with messages of this type, in any domain and of any version of the type."""
    return f"*/{topic}/{_dds_type(type_name)}/*"


def attachment(sequence: int, stamp_ns: int, gid: bytes) -> bytes:
    """What goes with each message: its number, when it was put, and the (16,) bytes that name its publisher."""
    return struct.pack(f"<qqB{GID_BYTES}s", sequence, stamp_ns, GID_BYTES, gid)


def gid_of(token: str) -> bytes:
    """The (16,) bytes that name the publisher of this token.

    rmw_zenoh takes XXH3 of the token; it needs no more of another's than that they are its own.
    """
    return hashlib.blake2b(token.encode(), digest_size=GID_BYTES).digest()


def node_token(domain: int, session_id: str, namespace: str) -> str:
    """The liveliness token by which ROS 2 sees wayfi as a node in `namespace`, "" for none."""
    return _token(domain, session_id, 0, "NN", namespace)


def publisher_token(domain: int, session_id: str, number: int, namespace: str, topic: RosTopic) -> str:
    """The liveliness token of the node's publisher of `topic` in `namespace`; `number` is above zero, one for each."""
    name = f"/{namespace}/{topic.name}" if namespace else f"/{topic.name}"
    entity = _token(domain, session_id, number, "MP", namespace)
    return f"{entity}/{_mangled(name)}/{_typed(topic.type_name)}/{_qos(topic)}"


def _token(domain: int, session_id: str, number: int, kind: str, namespace: str) -> str:
    return f"@ros2_lv/{domain}/{session_id}/0/{number}/{kind}/%/{_mangled('/' + namespace)}/{NODE}"


def _mangled(name: str) -> str:
    return name.replace("/", "%")


def _qos(topic: RosTopic) -> str:
    """Reliability, durability, history and depth, deadline, lifespan, liveliness; empty where they are the usual."""
    return f":{'1' if topic.kept else ''}:,{topic.depth}:,:,:,,"


def _typed(type_name: str) -> str:
    return f"{_dds_type(type_name)}/{TYPESTORE.hash_rihs01(type_name)}"


def _dds_type(type_name: str) -> str:
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"
