"""From what renderers delivered to verdicts, and who is off, and why."""
