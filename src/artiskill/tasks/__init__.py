"""What is asked: initial states, observations, rewards and success, as pure functions of snapshots."""
