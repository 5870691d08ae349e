"""Values of a network, as they stand in configs/learning/networks. Imports no torch."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from artiskill.config import CONFIG_DIR, check, check_not_negative, check_value, load_config
from artiskill.errors import check_name

NETWORKS = ("small", "small_transformer", "pointnet", "pointnet_transformer")
KINEMATIC = "kinematic"  # needs the robot's kinematics, which learners of commands know
FRAMES = ("world", "robot", "end_effector")  # of points, see `artiskill.envs.wrappers.Sampling`

_FOLDER = CONFIG_DIR / "learning" / "networks"
_WIDEST = 8192
_MOST_LAYERS = 32


@dataclass(frozen=True)
class InputConfig:
    """What a network sees of an observation, see `learning/features.py`."""

    # coordinates of each point, side by side: `cloud` minus the cloud's mean, `robot` in the frame of the robot's
    # base, `hand` from each hand, with the axes of the base; `tool` from each hand, with its own axes
    frames: tuple[Literal["cloud", "robot", "hand", "tool"], ...]
    near_m: float  # the last coordinates once more as tanh(x / near_m); 0: not
    colors: bool  # of each point
    masks: bool  # of each point
    state_per_point: bool  # the cloud's mean and the robot's state at every point
    state_in_head: bool  # the same beside the pooled features
    extents: bool  # mean, least and greatest coordinates of each mask, and of the points in none, with the state
    velocities: bool  # those in the robot's state; they tell the last action, which a policy then copies
    blind_to_robot: bool = False  # the last of several masks, the robot's, is empty
    # instead of the robot's state as observed: joints, hands and velocities as the base sees them, by forward
    # kinematics, so that nothing depends on where in the world the robot is
    body: bool = False
    origin: bool = False  # beside `body`: where the world's origin is, as the base sees it

    def __post_init__(self) -> None:
        check_not_negative(self, "near_m")
        is_legal = len(self.frames) > 0 and len(set(self.frames)) == len(self.frames)
        check_value(self, "frames", is_legal, "needs one to four different names")
        needed = "tool" in self.frames or self.origin
        check(self.body or not needed, "frames with tool, and origin, need body: true, for forward kinematics")
        check(
            not self.body or "hand" not in self.frames,
            "frames with hand need body: false; beside body, tool is legal",
        )


@dataclass(frozen=True)
class TransformerConfig:
    """Values of the transformer between the pooled points and the head."""

    width: int  # of a token
    blocks: int
    heads: int
    head_width: int
    feedforward: int
    dropout: float

    def __post_init__(self) -> None:
        for name in ("width", "heads", "head_width", "feedforward"):
            check_value(self, name, 1 <= getattr(self, name) <= _WIDEST, f"must lie in [1, {_WIDEST}]")
        check_value(self, "blocks", 0 <= self.blocks <= _MOST_LAYERS, f"must lie in [0, {_MOST_LAYERS}]")
        check_value(self, "dropout", 0.0 <= self.dropout < 1.0, "must lie in [0, 1)")


@dataclass(frozen=True)
class NetworkConfig:
    """Values of a network. All layers but the last are followed by ReLU."""

    kind: Literal["pointnet", "pointnet_transformer"]
    input: InputConfig
    point_layers: tuple[int, ...]  # widths of the layers that all points share
    pooling: Literal["max", "max_mean"]  # the largest of each channel; or that of one half, the mean of the other
    pool_norm: bool  # LayerNorm after pooling
    head: tuple[int, ...]  # widths of the hidden layers before the output
    head_norm: bool  # LayerNorm in each of them
    zero_output: bool  # the last layer begins with zeros
    transformer: TransformerConfig | None = None
    # some values as in the code of the ManiSkill paper, see `resolved`
    compat: Literal["none", "paper2021"] = "none"

    def __post_init__(self) -> None:
        for name in ("point_layers", "head"):
            widths = getattr(self, name)
            is_legal = 1 <= len(widths) <= _MOST_LAYERS and all(1 <= width <= _WIDEST for width in widths)
            check_value(self, name, is_legal, f"needs 1 to {_MOST_LAYERS} widths in [1, {_WIDEST}]")
        has_halves = self.point_layers[-1] % 2 == 0 or (self.pooling == "max" and self.compat == "none")
        check_value(self, "pooling", has_halves, "needs an even last width of point_layers for its halves")
        wanted = self.kind == "pointnet_transformer"
        check((self.transformer is not None) == wanted, f"kind {self.kind}: transformer {_must(wanted)} be given")

    def resolved(self) -> "NetworkConfig":
        """Return the values with those laid over them that `compat` stands for.

        Half of the pooled channels are means, nothing is normalised within the network, no layer begins with
        zeros, the robot's mask of cabinets is empty (a bug; the published numbers have it), and the head after a
        transformer has the hidden width 256. Padding, which counted in their means, does not count here.
        """
        if self.compat == "none":
            return self
        head = (256,) if self.transformer else self.head
        return dataclasses.replace(
            self,
            pooling="max_mean",
            pool_norm=False,
            head=head,
            head_norm=False,
            zero_output=False,
            input=dataclasses.replace(self.input, blind_to_robot=True),
            compat="none",
        )


def load_network_config(name: str, overrides: Mapping[str, Any] | None = None) -> NetworkConfig:
    """Read the values of a network that comes with the package.

    Args:
        name: one of `NETWORKS`, or `KINEMATIC`.
        overrides: dotted keys and other values, such as `{"head": [256, 256]}`.

    Raises:
        UnknownNameError: there is no such network.
        ConfigError: an unknown key or an illegal value.
    """
    check_name("network", name, (*NETWORKS, KINEMATIC))
    return load_config(NetworkConfig, _FOLDER / f"{name}.yaml", overrides)


def _must(wanted: bool) -> str:
    return "must" if wanted else "must not"
