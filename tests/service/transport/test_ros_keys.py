"""How ROS 2 names things on Zenoh: Zenoh's own matching and serialization read what is written here."""

from typing import Any

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st
from zenoh.ext import Int64, z_deserialize

from wayfi.recordings.ros.messages import OCCUPANCY_GRID, ODOMETRY, POSE_WITH_COVARIANCE, TF_MESSAGE, canonical_type
from wayfi.service.transport.ros_keys import (
    RosTopic,
    attachment,
    gid_of,
    node_token,
    publisher_token,
    rmw_key,
    rmw_key_expression,
)

STRING = "std_msgs/msg/String"
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
SESSION = "aac3178e146ba6f1fc6e6a4085e77f21"
TYPES = st.sampled_from((ODOMETRY, TF_MESSAGE, OCCUPANCY_GRID, POSE_WITH_COVARIANCE))
NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,8}(/[a-z][a-z0-9_]{0,8}){0,3}", fullmatch=True)
DOMAINS = st.integers(0, 232)
INT64 = st.integers(-(2**63), 2**63 - 1)


def parsed_key(key: str) -> tuple[int, str, str]:
    domain, rest = key.split("/", 1)
    topic, type_name, _ = rest.rsplit("/", 2)
    return int(domain), topic, canonical_type(type_name)


def parsed_token(token: str) -> dict[str, str]:
    where = ("space", "domain", "session", "node", "entity", "kind", "enclave", "namespace", "name")
    names = (*where, "topic", "type", "hash", "qos")
    return dict(zip(names, (part.replace("%", "/") for part in token.split("/")), strict=False))


def test_a_key_is_that_of_rmw_zenohs_documentation() -> None:
    assert rmw_key(2, "robot1/chatter", STRING) == f"2/robot1/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"


@given(DOMAINS, NAMES, TYPES)
def test_a_key_tells_what_it_was_made_of(domain: int, topic: str, type_name: str) -> None:
    assert parsed_key(rmw_key(domain, topic, type_name)) == (domain, topic, type_name)


@given(DOMAINS, NAMES, TYPES, NAMES, TYPES)
def test_the_expression_takes_the_topics_own_keys_and_no_others(
    domain: int, topic: str, type_name: str, other: str, other_type: str
) -> None:
    keys = zenoh.KeyExpr(rmw_key_expression(topic, type_name))
    assert keys.includes(zenoh.KeyExpr(rmw_key(domain, topic, type_name)))
    is_same = (other, other_type) == (topic, type_name)
    assert keys.intersects(zenoh.KeyExpr(rmw_key(domain, other, other_type))) == is_same


@given(NAMES, TYPES, NAMES)
def test_no_key_is_both_a_topics_own_and_rmws(topic: str, type_name: str, other: str) -> None:
    assert not zenoh.KeyExpr(rmw_key_expression(topic, type_name)).intersects(zenoh.KeyExpr(other))


@given(INT64, INT64, st.binary(min_size=16, max_size=16))
def test_zenohs_own_serialization_reads_an_attachment(sequence: int, stamp_ns: int, gid: bytes) -> None:
    data: Any = zenoh.ZBytes(attachment(sequence, stamp_ns, gid))
    assert len(data) == 33
    assert z_deserialize(tuple[Int64, Int64, bytes], data) == (sequence, stamp_ns, gid)


@pytest.mark.parametrize(
    ("topic", "qos"),
    [
        (RosTopic("chatter", STRING, depth=7), "::,7:,:,:,,"),
        (RosTopic("chatter", STRING, 1, latched=True), ":1:,1:,:,:,,"),
    ],
)
def test_a_token_is_that_of_rmw_zenohs_documentation(topic: RosTopic, qos: str) -> None:
    assert node_token(0, SESSION, "") == f"@ros2_lv/0/{SESSION}/0/0/NN/%/%/wayfi"
    assert publisher_token(0, SESSION, 10, "", topic) == (
        f"@ros2_lv/0/{SESSION}/0/10/MP/%/%/wayfi/%chatter/std_msgs::msg::dds_::String_/{STRING_HASH}/{qos}"
    )


@given(DOMAINS, st.one_of(st.just(""), NAMES), NAMES, TYPES, st.integers(1, 9))
def test_a_token_tells_what_it_was_made_of(domain: int, namespace: str, name: str, type_name: str, number: int) -> None:
    parts = parsed_token(publisher_token(domain, SESSION, number, namespace, RosTopic(name, type_name, depth=1)))
    inside = f"/{namespace}" if namespace else ""
    assert (parts["domain"], parts["entity"], parts["namespace"]) == (str(domain), str(number), inside or "/")
    assert (parts["topic"], canonical_type(parts["type"])) == (f"{inside}/{name}", type_name)


@given(NAMES, NAMES)
def test_each_publisher_has_a_name_of_its_own(one: str, other: str) -> None:
    assert len(gid_of(one)) == 16
    assert (gid_of(one) == gid_of(other)) == (one == other)
