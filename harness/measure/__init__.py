"""From images and ray paths to figures, each with its expectation and tolerance."""
