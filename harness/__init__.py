"""snellcheck: does a renderer refract light correctly, by how much is it off, and why."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("snellcheck")
except PackageNotFoundError:  # running from a tree that was never installed
    __version__ = "0+unknown"
