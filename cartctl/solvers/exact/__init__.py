"""The exact lexicographic engine behind ``sns`` and ``hqp``: compiled active-set methods on one working set.

Levels in order of priority, each scaled (s as large as possible), fitted (least squares) or kept inside an interval,
all under hard inequalities; then the point of least norm. ``lexicographic.py`` and ``by_levels.py`` run the levels,
``scaled.py`` and ``fitted.py`` solve one, ``descent.py`` is the dual active-set method, ``working_set.py`` its algebra.
"""
