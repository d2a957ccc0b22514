"""The one error of the package: a scene that cannot be traced, said in one message."""


class SceneError(ValueError):
    """What is wrong with the scene, the value seen, and what was expected."""
