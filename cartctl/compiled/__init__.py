"""Kinematics in flat arrays: one compiled loop for thousands of poses or rollouts, without a Python call inside."""
