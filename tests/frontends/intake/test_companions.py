"""Lasers are used together where each one's mount is known."""

from wayfi.frontends.events import Event, Warned
from wayfi.frontends.intake.companions import Companions
from wayfi.frontends.intake.mounts import Mounts
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.measurements import Transform

MS = 1_000_000


def companions(*mounted: str, one_mount: bool = False) -> Companions:
    mounts = Mounts(LidarConfig())
    for frame in mounted:
        mounts.add(Transform("base_link", frame, (0.1, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
    return Companions(mounts, one_mount)


def taken(choice: Companions, *arrivals: tuple[str, int]) -> list[bool]:
    return [choice.takes(ms * MS, frame) for frame, ms in arrivals]


def told(events: list[Event]) -> list[str]:
    return [event.text for event in events if isinstance(event, Warned)]


def test_those_with_mounts_are_used_together() -> None:
    assert taken(companions("a", "b"), ("a", 0), ("b", 0), ("/a", 100), ("b", 100)) == [True] * 4


def test_without_mounts_only_the_first_is_used_and_the_other_told_once() -> None:
    choice = companions()
    assert taken(choice, ("a", 0), ("b", 0), ("a", 100), ("b", 100)) == [True, False, True, False]
    (text,) = told([*choice.tell(0, "laser 'b'"), *choice.tell(1, "laser 'b'")])
    assert text.startswith("laser 'b': no /tf_static says where it is mounted, so that it is not used beside 'a'")


def test_one_with_a_mount_takes_over_from_one_without() -> None:
    assert taken(companions("b"), ("a", 0), ("b", 0), ("a", 100), ("b", 100)) == [True, True, False, True]


def test_one_without_a_mount_is_used_when_the_others_are_silent() -> None:
    assert taken(companions("a"), ("a", 0), ("b", 900), ("b", 1100), ("b", 1200)) == [True, False, True, True]


def test_a_mount_in_the_configuration_is_that_of_one_laser() -> None:
    choice = companions("a", "b", one_mount=True)
    assert taken(choice, ("a", 0), ("b", 0)) == [True, False]
    assert "lidar.mount is that of one laser" in told(list(choice.tell(0, "laser 'b'")))[0]
