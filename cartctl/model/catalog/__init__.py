"""Data: what the library knows of each robot beyond its URDF, one file a family."""
