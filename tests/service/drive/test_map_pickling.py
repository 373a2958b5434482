"""A drive is pickled without the map that it localises in, and unpickled with it."""

from building_maps.made_up import made_up_map

from wayfi.service.drive.map_pickling import MapPickling

KEYFRAMES = 60


def test_objects_of_the_map_are_the_same_again_and_take_no_room() -> None:
    known = made_up_map(KEYFRAMES)
    pickling, scans = MapPickling(known), [keyframe.scan for keyframe in known.keyframes]
    state = {"map": known, "scans": scans, "readings": known.fingerprints[3].readings, "grid": known.grid, "own": [1.5]}
    data = pickling.dumps(state)
    assert len(data) < 10 * KEYFRAMES
    again = pickling.loads(data)
    assert again["map"] is known
    assert again["grid"] is known.grid
    assert again["readings"] is known.fingerprints[3].readings
    assert all(a is b for a, b in zip(again["scans"], scans, strict=True))
    assert again["own"] == [1.5]


def test_another_process_finds_them_in_the_same_map() -> None:
    here, there = made_up_map(KEYFRAMES), made_up_map(KEYFRAMES)
    data = MapPickling(here).dumps([here.keyframes[8], here.poses])
    keyframe, poses = MapPickling(there).loads(data)
    assert keyframe is there.keyframes[8]
    assert poses is there.poses


def test_without_a_map_everything_is_pickled() -> None:
    pickling = MapPickling(None)
    assert pickling.loads(pickling.dumps({"a": (1, "b")})) == {"a": (1, "b")}
