"""What a level can be, and what an answer's flags say."""

SCALED, FITTED, INTERVAL = 0, 1, 2
CONTRADICTORY, STUCK, LOST_RANK, GENERAL, EXTREME = 1, 2, 4, 8, 16
