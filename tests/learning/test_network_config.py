from typing import Any

import pytest

from artiskill.config import from_mapping, to_mapping
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.learning.network_config import NETWORKS, NetworkConfig, load_network_config


@pytest.mark.parametrize("name", NETWORKS)
def test_each_network_survives_being_written(name: str) -> None:
    config = load_network_config(name)
    assert from_mapping(NetworkConfig, to_mapping(config)) == config


def test_an_unknown_network() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'pointnet'"):
        load_network_config("pointnett")


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("small", {"head": []}, "head needs 1 to 32 widths"),
        ("small", {"point_layers": [10**6]}, "point_layers needs 1 to 32 widths"),
        ("small", {"pooling": "max_mean", "point_layers": [63]}, "pooling needs an even last width"),
        ("small", {"kind": "pointnet_transformer"}, "transformer must be given"),
        ("pointnet_transformer", {"kind": "pointnet"}, "transformer must not be given"),
        ("pointnet_transformer", {"transformer.dropout": 1}, "dropout must lie in"),
        ("pointnet_transformer", {"transformer.heads": 0}, "heads must lie in"),
        ("small", {"input.frames": ["cloud", "cloud"]}, "frames needs one to four different names"),
        ("small", {"input.near_m": -1}, "near_m must be .* at least 0"),
        ("small", {"input.colours": True}, "did you mean 'colors'"),
        ("small", {"compat": "paper2020"}, "did you mean 'paper2021'"),
    ],
)
def test_illegal_values(name: str, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        load_network_config(name, changes)


@pytest.mark.parametrize("name", NETWORKS)
def test_what_compat_stands_for(name: str) -> None:
    config = load_network_config(name, {"compat": "paper2021"}).resolved()
    assert config.resolved() == config
    assert (config.pooling, config.pool_norm, config.head_norm, config.zero_output) == (
        "max_mean",
        False,
        False,
        False,
    )
    assert config.input.blind_to_robot
    assert config.head == ((256,) if config.transformer else (512, 256))
