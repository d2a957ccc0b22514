"""What physics says of a scene: laws, and closed forms along the paths of its rays."""
