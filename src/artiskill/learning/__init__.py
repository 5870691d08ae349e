"""Learning from demonstrations: training sets, networks, algorithms, trainer. The only place of torch.

`artiskill.learning` itself imports neither torch nor the engine.
"""
