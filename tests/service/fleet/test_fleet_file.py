from pathlib import Path

import pytest

from wayfi.service.fleet.fleet_file import FLEET, Fleet, FleetFileError, Member, parse_fleet, read_fleet

FLEET_OF_TWO = Fleet(
    (
        Member("robot1", "run", "1f", 3, (0.0, 0.0, 0.0), sessions=(2, 4)),
        Member("robot2", "run", "2f", 1, None, "the maps overlap too little"),
    )
)


def test_a_fleet_is_read_as_it_was_written(tmp_path: Path) -> None:
    (tmp_path / FLEET).write_text(FLEET_OF_TWO.to_json())
    assert read_fleet(tmp_path) == FLEET_OF_TWO
    assert read_fleet(tmp_path / "nowhere") == Fleet()


def test_a_place_is_that_of_the_robots_own_run() -> None:
    assert FLEET_OF_TWO.place_of("robot1", "run") == (0.0, 0.0, 0.0)
    assert FLEET_OF_TWO.place_of("robot1", "another run") is None
    assert FLEET_OF_TWO.place_of("robot2", "run") is None


@pytest.mark.parametrize(
    "data", [b"", b"[]", b'{"members": 1}', b'{"members": [{}]}', b"\xff", b'{"members": [3]}', b"[" * 100_000]
)
def test_what_is_no_fleet_is_one_line(data: bytes) -> None:
    with pytest.raises(FleetFileError, match=r"^somewhere: does not say how a common map is made"):
        parse_fleet(data, "somewhere")


@pytest.mark.parametrize("place", ["[NaN, 0, 0]", "[0, Infinity, 0]", f"[0, 0, 1{'0' * 400}]", "[0, 0]"])
def test_a_place_that_is_nowhere_is_refused(place: str) -> None:
    whole = Fleet((Member("r", "run", "1f", 1, (7.25, 0.0, 0.0)),)).to_json()
    start = whole.index("[", whole.index("T_common_map"))
    text = whole[:start] + place + whole[whole.index("]", start) + 1 :]
    with pytest.raises(FleetFileError):
        parse_fleet(text.encode(), "somewhere")
