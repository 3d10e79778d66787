"""The textbook terms of rigid-body dynamics, beside what Pinocchio computes."""
