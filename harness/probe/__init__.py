"""Position codes: per-ray optics measured from images alone, so that it works on any renderer."""
