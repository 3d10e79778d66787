"""The algebra of one step: problems, answers, inverses. Needs numpy and LAPACK, never Pinocchio."""
