"""The robots: from YAML to the robot's part of a model (bodies, joints, drives) and its drawn surfaces."""
