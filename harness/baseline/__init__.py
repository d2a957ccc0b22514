"""Approved results: what they are, where they are kept, and how a run stands to them."""
