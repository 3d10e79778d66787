"""What a level can be, and what an answer's flags say."""

from cartctl.algebra.proofs import FITTED, INTERVAL, SCALED

__all__ = ["CONTRADICTORY", "DOUBT", "EXTREME", "FITTED", "INTERVAL", "LOST_RANK", "SCALED", "STUCK", "UNPROVEN"]

CONTRADICTORY, STUCK, LOST_RANK, EXTREME, DOUBT, UNPROVEN = 1, 2, 4, 8, 16, 32
