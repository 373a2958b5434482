"""What is written of a configuration can be read back, whatever its values are."""

from pathlib import Path
from typing import Any

import pytest
from configurations import OPTIONS
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.service.config import Config, config_dict, config_of, config_toml, load_config
from wayfi.service.config.loading import SHARE_UNIT, SIGNED_UNIT

TEXT = st.text(max_size=20)
AWKWARD = "a\nb\r\n\t\"c\" 'd' \\ \x00 \x1f \x7f \x85 \u2028 \U0001f916 # [x] = ''' \"\"\""


def values_of(path: str, field: Any, default: Any) -> st.SearchStrategy[Any]:  # noqa: ANN401 - any option
    """Values that the option at `path` may have."""
    special = {
        "lidar.mount": st.one_of(st.just([]), st.lists(st.floats(-10, 10), min_size=3, max_size=3)),
        "rerun.port": st.integers(1, 65535),
        "zenoh.ros": st.sampled_from(["none", "bridge", "rmw"]),
        "zenoh.ros_domain": st.integers(0, 232),
    }
    least, most = {SIGNED_UNIT: (None, None), SHARE_UNIT: (0.0, 1.0)}.get(field.metadata["unit"], (0.0, None))
    ends = {"exclude_min": least is not None, "exclude_max": most is not None}
    by_type = {
        bool: st.booleans(),
        int: st.integers(1, 2**62),
        float: st.floats(least, most, **ends, allow_nan=False, allow_infinity=False),
        str: TEXT,
        list: st.lists(TEXT, max_size=3),
    }
    return special.get(path, by_type[type(default)])


def nested(values: dict[str, Any]) -> dict[str, Any]:
    """`section.key` as mappings within mappings."""
    tree: dict[str, Any] = {}
    for path, value in values.items():
        *sections, key = path.split(".")
        branch = tree
        for section in sections:
            branch = branch.setdefault(section, {})
        branch[key] = value
    return tree


CONFIGURATIONS = st.fixed_dictionaries(
    {}, optional={path: values_of(path, field, default) for path, field, default in OPTIONS}
).map(lambda values: config_of(nested(values)))


@settings(deadline=None, max_examples=60)
@given(CONFIGURATIONS, st.booleans())
def test_any_configuration_can_be_read_back_exactly(config: Config, explain: bool) -> None:
    assert load_config(base_toml=config_toml(config, explain)) == config
    assert config_of(config_dict(config)) == config


@pytest.mark.parametrize("explain", [False, True])
def test_a_written_file_is_the_same_configuration(tmp_path: Path, explain: bool) -> None:
    config = config_of({"recording": {"directory": AWKWARD}, "zenoh": {"listen": [AWKWARD, ""]}})
    path = tmp_path / "config.toml"
    path.write_bytes(config_toml(config, explain).encode())
    assert load_config([path]) == config


def test_an_explained_configuration_names_units_and_reasons() -> None:
    text = config_toml(Config(), explain=True)
    assert "# [dBm]" in text or "# [dB] the paper's sigma^2 = 36 dB^2" in text
    assert text.count("\n#") >= len(OPTIONS) - 1
