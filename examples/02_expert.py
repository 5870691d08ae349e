"""Watch the expert solve one level, and save the last picture: `python examples/02_expert.py picture.png`."""

import sys

import gymnasium as gym
from PIL import Image

import artiskill  # noqa: F401 - registers the environments
from artiskill.experts.open_cabinet import OpenCabinetExpert

env = gym.make("ArtiSkill/OpenCabinetDrawer-v0", objects="test", render_mode="rgb_array").unwrapped
observation, info = env.reset(seed=3)
expert = OpenCabinetExpert(env.task.robot)  # privileged: it sees the simulation's state, not the observation

phase, steps, done = None, 0, False
while not done:
    command = expert.command(env.snapshot, env.goal)
    if command.phase != phase:
        phase = command.phase
        print(f"step {steps:3d}: {expert.phases[phase]}")
    action = expert.controller.action(env.snapshot, command)
    observation, reward, terminated, truncated, info = env.step(action)
    steps, done = steps + 1, terminated or truncated
print(f"{info['object']}, {info['target']}: {'solved' if info['success'] else 'not solved'} after {steps} steps")
if len(sys.argv) > 1:
    Image.fromarray(env.render()).save(sys.argv[1])
