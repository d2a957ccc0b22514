"""Scene files: read, validated, expanded over their axes and resolved to numbers."""
