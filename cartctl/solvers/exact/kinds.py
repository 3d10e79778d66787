"""What a level can be, and what an answer's flags say."""

SCALED, FITTED, INTERVAL = 0, 1, 2
RELAXED, STUCK, LOST_RANK, GENERAL = 1, 2, 4, 8
