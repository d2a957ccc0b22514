"""Malformed input, made by the thousand: none of it may end in a traceback, a hang or a flood."""
