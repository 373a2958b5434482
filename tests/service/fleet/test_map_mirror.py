"""A map is fetched from another program: only what has changed, all of it or nothing, and nothing that is no map."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import zenoh
from building_maps.rounds import round_map
from live.loopback import endpoint

from wayfi.recordings.files.map_folder import KEYFRAMES, MANIFEST, MapError, delete_map
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.manifest import MapName, checksum_of, manifest_text, read_manifest
from wayfi.recordings.map.saving import STAGED, name_of_map, save_map
from wayfi.service.blackbox.run_folder import RunFolder
from wayfi.service.config import ZenohConfig
from wayfi.service.fleet.map_mirror import FetchError, found, mirror
from wayfi.service.fleet.map_server import MapServer
from wayfi.service.process.log_lines import LogLines
from wayfi.service.transport.zenoh_session import open_session

KEY = "robot1/wayfi/keyframes"


class Served:
    """A program that serves the map in `folder`, a session of another one, and the copy that it keeps."""

    def __init__(self, session: zenoh.Session, place: Path) -> None:
        self.session = session
        self.folder, self.copy = place / "map", place / "copy"
        save_map(self.folder, round_map())

    def mirror(self) -> MapName | None:
        (manifest,) = [data for _, data in found(self.session, f"**/wayfi/keyframes/*/{MANIFEST}")]
        return mirror(self.session, f"{KEY}/run", manifest, self.copy)


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    where = endpoint()
    with (
        open_session(ZenohConfig(listen=[where])) as server,
        open_session(ZenohConfig(mode="client", connect=[where])) as client,
        MapServer(server, KEY, lambda: {"run": tmp_path / "map"}, LogLines()),
    ):
        yield Served(client, tmp_path)


def test_the_copy_is_the_map_to_the_byte(served: Served) -> None:
    assert served.mirror() == name_of_map(served.folder)
    names = {path.name for path in served.folder.iterdir()}
    assert {path.name: path.read_bytes() for path in served.copy.iterdir()} == {
        name: (served.folder / name).read_bytes() for name in names
    }
    assert served.mirror() is None


def test_only_what_has_changed_is_fetched(served: Served) -> None:
    served.mirror()
    before = {path.name: path.stat().st_ino for path in served.copy.iterdir()}
    save_map(served.folder, round_map(), former=name_of_map(served.folder))
    assert served.mirror().map_version == 2
    assert {path.name for path in served.copy.iterdir() if path.stat().st_ino != before[path.name]} == {MANIFEST}


def test_what_is_damaged_on_its_way_leaves_the_copy_as_it_was_and_the_rest_is_fetched_once(served: Served) -> None:
    served.mirror()
    before = name_of_map(served.copy)
    save_map(served.folder, round_map(rounds=3), former=before)
    whole = (served.folder / KEYFRAMES).read_bytes()
    (served.folder / KEYFRAMES).write_bytes(whole[:-1] + b"x")
    with pytest.raises(FetchError, match=r"keyframes\.parquet: was changed since it was written"):
        served.mirror()
    assert (load_map(served.copy).name, load_map(served.copy).warnings) == (before, ())
    fetched = {path.name: path.stat().st_ino for path in (served.copy / STAGED).iterdir() if path.name != MANIFEST}
    assert fetched
    (served.folder / KEYFRAMES).write_bytes(whole)
    assert served.mirror() == name_of_map(served.folder)
    assert {name: (served.copy / name).stat().st_ino for name in fetched} == fetched
    assert len(load_map(served.copy).building.keyframes) == 180


def test_a_file_that_nobody_serves_any_more_is_named(served: Served) -> None:
    (served.folder / KEYFRAMES).unlink()
    with pytest.raises(FetchError, match=r"robot1/wayfi/keyframes/run/keyframes\.parquet: nobody answers"):
        served.mirror()
    assert name_of_map(served.copy) is None


def test_a_name_that_leads_out_of_the_folder_is_refused(served: Served) -> None:
    manifest = read_manifest(served.folder)
    files = {**manifest.files, "../../evil": checksum_of(b"x")}
    (served.folder / MANIFEST).write_text(manifest_text(replace(manifest, files=files)))
    with pytest.raises(MapError, match=r"names a file that is of no map: '\.\./\.\./evil'"):
        served.mirror()
    assert not (served.copy.parent.parent / "evil").exists()


@pytest.mark.parametrize("manifest", [b"", b"{}", b"\xff", b'{"format": "wayfi-map", "version": 99}', b"[" * 100_000])
def test_what_is_no_manifest_is_refused(served: Served, manifest: bytes) -> None:
    served.mirror()
    (served.folder / MANIFEST).write_bytes(manifest)
    with pytest.raises(MapError):
        served.mirror()
    assert load_map(served.copy).warnings == ()


def test_nothing_but_the_files_of_maps_is_served(served: Served) -> None:
    (served.folder / "secret.txt").write_text("x")
    assert list(found(served.session, f"{KEY}/run/secret.txt")) == []
    assert list(found(served.session, f"{KEY}/other/{MANIFEST}")) == []
    assert [key for key, _ in found(served.session, f"{KEY}/run/{MANIFEST}")] == [f"{KEY}/run/{MANIFEST}"]


def test_a_copy_of_which_the_manifest_alone_was_kept_is_fetched_whole_once_there_is_a_new_version(
    served: Served,
) -> None:
    served.mirror()
    delete_map(served.copy, [MANIFEST])
    assert served.mirror() is None
    save_map(served.folder, round_map(), former=name_of_map(served.folder))
    assert served.mirror().map_version == 2
    assert load_map(served.copy).warnings == ()


def test_where_the_runs_cannot_be_listed_the_answer_is_an_error_and_the_log_says_so_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs, where = tmp_path / "runs", endpoint()
    save_map(runs / "run" / "map", round_map())
    folder = RunFolder(runs / "run", None, 0)
    with (
        open_session(ZenohConfig(listen=[where])) as server,
        open_session(ZenohConfig(mode="client", connect=[where])) as client,
        MapServer(server, KEY, folder.maps_served, LogLines()),
    ):
        asked = f"**/wayfi/keyframes/*/{MANIFEST}"
        runs.rename(tmp_path / "gone")
        told = [reply.err.payload.to_string() for _ in range(2) for reply in client.get(asked, timeout=10.0)]
        (tmp_path / "gone").rename(runs)
        assert len(list(found(client, asked))) == 1
    assert told == [f"{runs}: cannot be listed: No such file or directory; no map is served"] * 2
    assert capsys.readouterr().err.count("cannot be listed") == 1
