"""Camera paths through a scene's free space, and how much of the scene they see."""
