"""Learning from demonstrations: training sets, networks, algorithms, trainer. The only place of torch.

`artiskill.learning` itself imports neither torch nor the engine.
"""

import os

# Threads of OpenMP wait for one another without spinning: where others use the cores, too, training is six to
# eight times as fast, and elsewhere no slower. It is read when torch is loaded.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
