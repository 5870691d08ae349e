"""Demonstrations that come with the package, seen as point clouds: `python examples/06_demonstrations.py`."""

import artiskill
from artiskill.envs.wrappers import PointCloudDownsample

demos = artiskill.load_demo_pack("OpenCabinetDrawer")  # of your own collection: Demos("demos/drawers")
print(f"{len(demos)} demonstrations of {', '.join(demos.objects)}")
with demos.open(demos.objects[0]) as file:
    trajectory = file.trajectory(0)
    env = PointCloudDownsample(file.make_env("pointcloud"), num_points=1200)

observation, info = env.reset(options={"level": trajectory.level, "target": trajectory.target})
for action in trajectory.actions:
    observation, reward, terminated, truncated, info = env.step(action)
assert reward == trajectory.rewards[-1]  # the same bits as when it was recorded
xyz = observation["pointcloud"]["xyz"]
print(f"{info['object']}, {info['target']}: {len(trajectory)} steps, solved: {info['success']}, {len(xyz)} points")
