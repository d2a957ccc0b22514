"""Figures of past runs: kept, shown, and followed to the commit that changed them."""
