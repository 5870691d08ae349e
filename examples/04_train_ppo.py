"""Learn to open one drawer with PPO of Stable-Baselines3: `pip install 'artiskill[rl]'`, see the docs."""

import argparse
import csv
from collections.abc import Callable
from pathlib import Path

import gymnasium as gym
import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFont
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

import artiskill  # noqa: F401 - registers the environments

GAMMA = 0.95  # looks one second ahead
SMOOTH = 50  # episodes behind each point of the curve
COLUMNS = ("steps", "return", "length", "success")
# what the state says beyond the paper's, or in its place: where things are
STATE = {task: {"state.handle": True} for task in ("OpenCabinetDrawer", "OpenCabinetDoor")}
STATE |= {task: {"state.relative": True} for task in ("PushChair", "MoveBucket")}
Row = tuple[int, float, int, int]
LEFT, RIGHT = 160, 1530  # of the curves, in pixels


class EpisodeLog(BaseCallback):
    """Keeps a row of `COLUMNS` of every episode and says now and then how it goes."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[Row] = []

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "episode" in info:  # the last step of one
                episode = info["episode"]
                self.rows.append((self.num_timesteps, episode["r"], episode["l"], int(info["success"])))
        return True

    def _on_rollout_end(self) -> None:
        if self.rows:
            _, score, _, success = np.mean(self.rows[-SMOOTH:], axis=0)
            print(f"{self.num_timesteps:8d} steps: return {score:8.1f}, {success:4.0%} solved", flush=True)


def train(arguments: argparse.Namespace) -> tuple[PPO, VecNormalize, list[Row]]:
    """The policy, what scales its observations, and the episodes it learned from."""

    def make() -> gym.Env:
        task, config = f"ArtiSkill/{arguments.task}-v0", STATE.get(arguments.task)
        return Monitor(gym.make(task, objects=arguments.object, target=arguments.target, config=config))

    # positions are tenths of metres, velocities rarely reach their bound of 100: scale by what is really seen
    env = VecNormalize(DummyVecEnv([make] * arguments.envs), gamma=GAMMA)
    model = PPO(
        "MlpPolicy",
        env,
        n_steps=arguments.rollout // arguments.envs,
        batch_size=min(256, arguments.rollout),
        gamma=GAMMA,
        policy_kwargs={"net_arch": [256, 256], "log_std_init": -0.5},  # actions reach +-1: begin with +-0.6
        seed=arguments.seed,
        device="cpu",
    )
    log = EpisodeLog()
    model.learn(arguments.steps, callback=log)
    return model, env, log.rows


def draw_curves(rows: list[Row], title: str) -> Image.Image:
    """Above the return of each episode and its running mean, below the share solved, over environment steps."""
    steps, returns, _, success = np.array(rows, dtype=float).T
    image = Image.new("RGB", (1600, 1240), "white")  # drawn twice as large, for smooth lines
    draw = ImageDraw.Draw(image)
    text(draw, (LEFT, 30), title, size=38)
    draw_panel(
        draw, 110, steps, returns, "episode return (dense reward), and mean of 50", ticks_of(returns), dots=True
    )
    draw_panel(draw, 670, steps, 100 * success, "solved, % of the last 50 episodes", np.linspace(0, 100, 5))
    text(draw, ((LEFT + RIGHT) / 2, 1195), "environment steps", anchor="mm")
    return image.resize((800, 620), Image.Resampling.LANCZOS)


def draw_panel(
    draw: ImageDraw.ImageDraw,
    top: int,
    x: np.ndarray,
    y: np.ndarray,
    title: str,
    marks: np.ndarray,
    dots: bool = False,
) -> None:
    """A title, a frame of 400 pixels in height with lines at `marks`, and the curve."""

    def height(value: np.ndarray) -> np.ndarray:
        return top + 460 - 400 * (value - marks[0]) / (marks[-1] - marks[0])

    across = LEFT + (RIGHT - LEFT) * x / x.max()
    text(draw, (LEFT, top), title)
    for mark in marks:
        draw.line((LEFT, height(mark), RIGHT, height(mark)), fill="#dddddd", width=2)
        text(draw, (LEFT - 16, height(mark)), f"{mark:,.0f}", anchor="rm")
    for mark in ticks_of(np.append(x, 0.0)):
        if mark <= x.max():
            text(draw, (LEFT + (RIGHT - LEFT) * mark / x.max(), top + 485), f"{mark:,.0f}", anchor="mm")
    for a, b in zip(across, height(y), strict=True):
        if dots:
            draw.ellipse((a - 3, b - 3, a + 3, b + 3), fill="#9cc3e0")
    means = [y[max(0, i - SMOOTH) : i].mean() for i in range(1, len(y) + 1)]
    draw.line(list(zip(across, height(np.array(means)), strict=True)), fill="#1f5f99", width=5, joint="curve")


def ticks_of(values: np.ndarray) -> np.ndarray:
    """Round numbers, at least two, that the values lie between."""
    span = max(float(np.ptp(values)), 1.0)
    step = next(s * 10**e for e in range(12) for s in (1, 2, 5) if s * 10**e >= span / 5)
    return np.arange(np.floor(values.min() / step), np.ceil(values.max() / step) + 1) * step


def text(
    draw: ImageDraw.ImageDraw, place: tuple[float, float], words: str, size: int = 30, anchor: str = "la"
) -> None:
    draw.text(place, words, fill="#222222", font=ImageFont.load_default(size), anchor=anchor)


def write_csv(path: Path, rows: list[Row]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([COLUMNS, *rows])


def write(path: Path, writer: Callable[[Path], object]) -> None:
    """Whole or not at all: under a temporary name until then."""
    temporary = path.with_name(f"unfinished-{path.name}")
    writer(temporary)
    temporary.replace(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="OpenCabinetDrawer")
    parser.add_argument("--object", default="cabinet-0003")
    parser.add_argument("--target", help="a link; by default each episode draws one")
    parser.add_argument("--steps", type=int, default=400_000)
    parser.add_argument(
        "--rollout", type=int, default=2048, help="steps between two updates, over all environments"
    )
    parser.add_argument("--envs", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("results/ppo"))
    arguments = parser.parse_args()
    if arguments.rollout < 2 * arguments.envs:
        parser.error(
            f"--rollout {arguments.rollout} is less than two steps of each of {arguments.envs} environments"
        )
    arguments.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)  # small networks: more threads only wait for one another
    model, env, rows = train(arguments)
    write(arguments.out / "policy.zip", model.save)
    write(arguments.out / "scaling.pkl", env.save)
    write(arguments.out / "episodes.csv", lambda path: write_csv(path, rows))
    if rows:  # at least one episode has ended
        title = f"PPO, {arguments.task}, {arguments.object} {arguments.target or ''}, seed {arguments.seed}"
        write(arguments.out / "curve.png", draw_curves(rows, title).save)
    print(f"wrote policy.zip, scaling.pkl, episodes.csv{', curve.png' * bool(rows)} to {arguments.out}")


if __name__ == "__main__":
    main()
