"""Closing the loop: controller, simulation, and the run that remembers it."""
