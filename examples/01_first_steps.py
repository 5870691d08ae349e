"""Ten lines: a robot, a cabinet it has never seen, and random actions."""

import gymnasium as gym

import artiskill  # noqa: F401 - registers the environments

env = gym.make("ArtiSkill/OpenCabinetDrawer-v0", objects="test")
observation, info = env.reset(seed=0)  # level 0: which cabinet, which drawer, where the robot stands
print(f"open {info['target']} of {info['object']}")
print(f"observation {observation.shape}, action {env.action_space.shape}")
for _ in range(20):
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
print(f"reward {reward:.2f}, {info['flags']}")
env.close()
