"""Every tolerance of the tests of algebra and solvers, named once.

Relative ones are meant relative to the size of what is compared; the problems they are used on have singular values
within 0.3 and 3, so a tolerance far above round-off hides nothing.
"""

from __future__ import annotations

EXACT = 1e-12  # the same formula, evaluated twice
ORACLE = 1e-9  # against an independent solve that may square the condition number
PENROSE = 1e-11  # the four conditions, per unit of the matrices in them
LEAK = 1e-12  # ||A N u0|| per ||A|| ||u0||: what of the null-space motion reaches the task
DIFFERENCE = 1e-7  # against central differences with step 1e-6
ROTATION = 1e-14  # rotation matrices, element by element
HALF_TURN = 1e-7  # logarithms against an oracle that loses half the digits at 180 degrees
LOG = 1e-13  # logarithms, absolute, rad
JACOBIAN = 1e-12  # two ways to the same Jacobian, links of about a metre
PROMISE = 1.0 + 1e-9  # slack on a bound that a policy promises
DAMPED = 1e-8  # damped least squares with lambda of at least 1e-2 sigma_max
NEARLY_UNDAMPED = 1e-5  # damped least squares with less, per unit of the answer
MET = 1e-6  # an equation called met leaves no more than this of its command
EPS = 2.0**-52
