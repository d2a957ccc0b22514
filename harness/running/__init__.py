"""Carrying a plan out: lanes of renderers, what is known already, shards, clusters."""
