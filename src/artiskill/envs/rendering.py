class WorldView:
    pass
