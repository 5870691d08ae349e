"""PPO of Stable-Baselines3 over many objects at once: `pip install 'artiskill[rl]'`, see the docs."""

import argparse
from pathlib import Path

import gymnasium as gym
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

import artiskill

GAMMA = 0.95  # looks one second ahead
# what the state says beyond the paper's, or in its place: where things are
STATE = {task: {"state.handle": True} for task in ("OpenCabinetDrawer", "OpenCabinetDoor")}
STATE |= {task: {"state.relative": True} for task in ("PushChair", "MoveBucket")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="OpenCabinetDrawer")
    parser.add_argument("--objects", default="train", help="a split or an object's id")
    parser.add_argument("--num-envs", type=int, default=64)
    parser.add_argument("--rollout", type=int, default=32, help="steps of each environment between updates")
    parser.add_argument("--steps", type=int, default=200_000, help="of all environments together")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="results/ppo_many", help="a folder")
    arguments = parser.parse_args()

    built = artiskill.warm_scenes(arguments.task, arguments.objects)
    env = gym.make_vec(
        f"ArtiSkill/{arguments.task}-v0",
        num_envs=arguments.num_envs,
        objects=arguments.objects,
        config=STATE.get(arguments.task),
        autoreset_mode="same_step",
    )
    print(f"{arguments.num_envs} environments, {built} objects")
    # positions are tenths of metres, velocities rarely reach their bound of 100: scale by what is really seen
    batch = VecNormalize(VecMonitor(artiskill.as_sb3(env), info_keywords=("success",)), gamma=GAMMA)
    model = PPO(
        "MlpPolicy",
        batch,
        n_steps=arguments.rollout,
        batch_size=min(512, arguments.rollout * arguments.num_envs),
        gamma=GAMMA,
        policy_kwargs={"net_arch": [256, 256], "log_std_init": -0.5},  # actions reach +-1: begin with +-0.6
        seed=arguments.seed,
        device="cpu",
        verbose=1,
    )
    model.learn(arguments.steps)
    out = Path(arguments.out)
    out.mkdir(parents=True, exist_ok=True)
    model.save(out / "policy.zip")
    batch.save(str(out / "scaling.pkl"))  # the policy sees scaled observations: it is nothing without
    print(f"saved {out}")


if __name__ == "__main__":
    main()
