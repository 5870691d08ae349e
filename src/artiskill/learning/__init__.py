"""Learning from demonstrations: training sets, networks, algorithms, trainer. The only place of torch.

`artiskill.learning` itself imports neither torch nor the engine.
"""

import os

# Torch's threads on a CPU wait for each other by spinning unless they are told otherwise before torch is imported.
# Where anything else runs on the cores, that is six times slower (4.5 against 27 small steps per second).
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
