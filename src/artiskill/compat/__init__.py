"""Other frameworks' ways to name environments and policies: 2021's solutions, LeRobot, vla-eval."""
