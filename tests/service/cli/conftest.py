"""The recording that tests of the commands share."""

from pathlib import Path

import pytest
from drives import Simulated, write


@pytest.fixture(scope="package")
def recording(minute: Simulated, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten seconds."""
    first = [a for a in minute.arrivals if a.second <= 10.0]
    return write(tmp_path_factory.mktemp("recording") / "recording.mcap", first)
