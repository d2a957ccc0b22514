"""One file per command of `snellcheck`, each with a click command named `command`.

A file put here is a command: `harness.cli` finds it by its name.
"""
