"""Soaking: random problems and random closed-loop steps for as long as asked, every answer checked by its certificate.

``draws.py``, ``matrices.py``, ``bounds.py`` and ``problems.py`` make one problem, ``judge.py`` solves and
judges it, ``batch.py`` compiles that into one kernel. ``scenes.py`` and ``loops.py`` are the closed loops, ``tally.py``
the counts.
"""
