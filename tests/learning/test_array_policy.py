"""A policy in a file acts as the algorithm that it came from, without torch; what is no such file is refused."""
# ruff: noqa: E402

import dataclasses
import hashlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from tests.learning.clouds import CABINET, CHAIR, narrow, plain_statistics

from artiskill.config import CONFIG_DIR, from_mapping, load_yaml
from artiskill.errors import ConfigError, PolicyError
from artiskill.evaluation.evaluate import evaluate
from artiskill.learning.array_policy import ArrayPolicy, Header, write_policy
from artiskill.learning.batch import Observation, Sizes
from artiskill.learning.bc import BC
from artiskill.learning.bcq import BCQ
from artiskill.learning.network_config import NETWORKS, NetworkConfig
from artiskill.learning.networks import make_network
from artiskill.learning.observation import ObservationLayout
from artiskill.learning.td3bc import TD3BC

ALGORITHMS = {"bc": BC, "bcq": BCQ, "td3bc": TD3BC}


def make_algorithm(name: str, network: NetworkConfig, sizes: Sizes, frame: str) -> Any:
    generator = torch.Generator().manual_seed(7)
    statistics = plain_statistics(sizes.agent)._replace(
        point_std=np.full(3, 2.0), agent_mean=np.full(sizes.agent, 0.5)
    )

    def make(outputs: int, extra: int) -> Any:
        return make_network(network, sizes, statistics, outputs, extra, generator, frame)

    values = load_yaml(CONFIG_DIR / "learning" / f"{name}.yaml")["algorithm"]
    kind = ALGORITHMS[name]
    return kind(from_mapping(kind.Config, values), make, sizes)


def export(path: Path, name: str, network: NetworkConfig, sizes: Sizes = CABINET, frame: str = "world") -> Any:
    """Write the policy file of an algorithm with random weights; return the algorithm."""
    algorithm = make_algorithm(name, network, sizes, frame)
    sampling = {"num_points": sizes.points, "method": "uniform", "frame": frame}
    header = Header(
        task="OpenCabinetDrawer",
        algorithm=name,
        control_mode="joint",
        sampling=sampling,
        observation_config={},
        frame=frame,
        **dataclasses.asdict(sizes),
        network=network,
    )
    write_policy(path, header, {key: value.numpy() for key, value in algorithm.state_dict().items()})
    return algorithm


def cloud(sizes: Sizes, seed: int, real: int = 30) -> dict[str, Any]:
    """An environment's observation whose last points are padding."""
    rng = np.random.default_rng(seed)
    n = sizes.points
    xyz = np.where(np.arange(n)[:, None] < real, rng.normal(size=(n, 3)), 0.0).astype(np.float32)
    seg = rng.integers(sizes.masks + 1, size=(n, 1)) == np.arange(sizes.masks)
    seg[:, 0] &= seed % 2 == 0  # an empty mask
    rgb = rng.integers(256, size=(n, 3), dtype=np.uint8)
    return {
        "pointcloud": {"xyz": xyz, "rgb": rgb, "seg": seg},
        "agent": rng.normal(size=sizes.agent).astype(np.float32),
    }


def check_same_actions(policy: ArrayPolicy, algorithm: Any, sizes: Sizes) -> None:
    layout = ObservationLayout(sizes.points, sizes.masks, sizes.agent)
    for seed in range(4):
        seen = cloud(sizes, seed, real=30 if seed < 3 else 0)
        tensors = Observation(*map(torch.from_numpy, layout.observe(seen)))
        action = policy.act(seen)
        assert action.dtype == np.float32
        np.testing.assert_allclose(action, algorithm.act(tensors)[0].numpy(), atol=1e-5)


@pytest.mark.parametrize("compat", ["none", "paper2021"])
@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("network", NETWORKS)
def test_it_acts_as_its_algorithm(tmp_path: Path, network: str, algorithm: str, compat: Any) -> None:
    made = export(tmp_path / "policy.npz", algorithm, narrow(network, compat=compat))
    check_same_actions(ArrayPolicy(tmp_path / "policy.npz"), made, CABINET)


@pytest.mark.parametrize("frame", ["world", "robot", "end_effector"])
def test_it_acts_as_its_algorithm_with_two_arms(tmp_path: Path, frame: str) -> None:
    made = export(tmp_path / "policy.npz", "bc", narrow("small"), CHAIR, frame)
    check_same_actions(ArrayPolicy(tmp_path / "policy.npz"), made, CHAIR)


def test_it_says_what_it_needs(tmp_path: Path) -> None:
    export(tmp_path / "policy.npz", "bc", narrow("small"), frame="robot")
    policy = ArrayPolicy(tmp_path / "policy.npz")
    assert (policy.obs_mode, policy.control_mode) == ("pointcloud", "joint")
    assert policy.sampling == {"num_points": 40, "method": "uniform", "frame": "robot"}
    with pytest.raises(ConfigError, match="shapes"):
        policy.act(cloud(CHAIR, 0))


def test_it_needs_no_torch(tmp_path: Path) -> None:
    export(tmp_path / "policy.npz", "bcq", narrow("pointnet_transformer"))
    code = (
        "import sys; sys.modules.update(torch=None, mujoco=None)\n"
        "from artiskill.learning.array_policy import ArrayPolicy\n"
        f"print(ArrayPolicy({str(tmp_path / 'policy.npz')!r}).header.algorithm)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "bcq\n"


def changed(path: Path, **changes: Any) -> None:
    """Write a policy file anew, with other arrays, or none where they are None."""
    with np.load(path) as archive:
        values = {**{name: archive[name] for name in archive.files}, **changes}
    np.savez(path, **{name: value for name, value in values.items() if value is not None})


def changed_header(path: Path, **changes: Any) -> None:
    with np.load(path) as archive:
        header = json.loads(str(archive["header"]))
    changed(path, header=np.array(json.dumps(header | changes)))


@pytest.fixture
def policy_file(tmp_path: Path) -> Path:
    export(tmp_path / "policy.npz", "bc", narrow("small"))
    return tmp_path / "policy.npz"


OUTPUT_BIAS = "policy.mlp.output.bias"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda path: path.unlink(), "there is no policy file"),
        (lambda path: path.write_bytes(path.read_bytes()[:-100]), "or cut off"),
        (lambda path: path.write_bytes(b"nothing of the kind"), "no file of `artiskill export-policy`"),
        (lambda path: np.savez(path, header=np.array('{"format": "other"}')), "no file of"),
        (lambda path: changed(path, header=None), "no file of"),
        (lambda path: changed(path, header=np.array([{}], dtype=object)), "no file of"),
        (lambda path: changed_header(path, version=3), "version 3; this version of artiskill reads 2"),
        (lambda path: changed_header(path, algorithm="bcp"), "is damaged: .* did you mean 'bc'"),
        (lambda path: changed_header(path, points=10**9), "points must lie in"),
        (lambda path: changed_header(path, frame="moon"), "frame"),
        (lambda path: changed_header(path, frame="robot"), "in frame 'robot', and are sampled in 'world'"),
        (lambda path: changed_header(path, action=3), "do not fit its actions"),
        (lambda path: changed_header(path, masks=2), "do not fit its network"),
        (lambda path: changed(path, **{"policy.mlp.output.weight": None}), "do not fit its network"),
        (
            lambda path: changed(path, **{OUTPUT_BIAS: np.full(13, np.nan, np.float32)}),
            "finite numbers",
        ),
        (lambda path: changed(path, **{OUTPUT_BIAS: np.zeros(13)}), "finite numbers"),
    ],
)
def test_what_is_no_policy_file_is_refused(policy_file: Path, change: Any, message: str) -> None:
    change(policy_file)
    with pytest.raises(PolicyError, match=message) as found:
        ArrayPolicy(policy_file)
    assert "\n" not in str(found.value)


def test_a_flipped_bit_is_noticed(policy_file: Path) -> None:
    content = bytearray(policy_file.read_bytes())
    content[len(content) // 2] ^= 16
    policy_file.write_bytes(content)
    with pytest.raises(PolicyError, match="cannot read"):
        ArrayPolicy(policy_file)


def test_the_name_of_a_policy_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"must end in \.npz"):
        export(tmp_path / "policy.zip", "bc", narrow("small"))


def test_evaluation_takes_a_policy_file(tmp_path: Path) -> None:
    path = tmp_path / "policy.npz"
    export(path, "bc", narrow("small"))
    report = evaluate(
        "OpenCabinetDrawer", path, ["cabinet-0001"], episodes=1, config={"episode_steps": 2}
    ).to_mapping()
    assert (report["obs_mode"], report["control_mode"]) == ("pointcloud", "joint")
    assert report["sampling"]["num_points"] == 40
    assert report["policy_sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    assert report["objects"][0]["mean_length"] == 2
