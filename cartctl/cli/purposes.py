"""Objectives by name, as the command line offers them: see :mod:`cartctl.objectives.named`."""

from cartctl.objectives.named import KNOWN, Known, aimed, in_words

__all__ = ["KNOWN", "Known", "aimed", "in_words"]
