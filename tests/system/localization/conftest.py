"""The map that the tests of localisation share."""

import pytest
from buildings.localizing import Mapped, map_of
from buildings.robots import drive
from buildings.storey import ROUTE, storey


@pytest.fixture(scope="session")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> Mapped:
    """The map of the storey, of its first day."""
    return map_of(drive(storey(), ROUTE, day=0), tmp_path_factory.mktemp("mapped"))
