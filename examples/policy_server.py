"""A policy for `artiskill evaluate --policy ws://localhost:8000`; needs msgpack, numpy and websockets only."""

import sys
import traceback

import msgpack
import numpy as np
from websockets.sync.server import serve

METADATA = {"obs_mode": "pointcloud", "control_mode": "joint", "points": 256, "frame": "robot", "replan_steps": 4}


def policy(observation, is_first):
    """Return the next actions, (H, A) in [-1, 1], from arrays by key: here, back and forth before what is seen."""
    points = observation["observation/pointcloud/xyz"][observation["observation/pointcloud/seg"][:, 0]]
    ahead = points[:, 0].mean() if len(points) else 1.0  # metres to the target's handles
    actions = np.zeros((8, 13), np.float32)
    actions[:, 0] = np.clip(ahead - 0.8, -1.0, 1.0)  # the base's velocity, forward
    return actions


def encode(value):
    return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}


def decode(found):
    is_array = b"__ndarray__" in found
    return np.frombuffer(found[b"data"], found[b"dtype"]).reshape(found[b"shape"]) if is_array else found


def answer(connection):
    connection.send(msgpack.packb(METADATA))
    try:
        for message in connection:
            observation = msgpack.unpackb(message, object_hook=decode)
            actions = policy(observation, is_first=observation.get("reset", False))
            connection.send(msgpack.packb({"actions": actions}, default=encode))
    except Exception:
        connection.send(traceback.format_exc())
        connection.close(1011)
        raise


if __name__ == "__main__":
    port = int(sys.argv[1]) if len(sys.argv) > 1 else 8000
    with serve(answer, "localhost", port, compression=None, max_size=None, ping_interval=None) as server:
        print(f"a policy at ws://localhost:{server.socket.getsockname()[1]}; Ctrl-C ends", flush=True)
        server.serve_forever()
