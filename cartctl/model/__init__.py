"""The robot as data: URDF, limits, states. Knows no solver."""
