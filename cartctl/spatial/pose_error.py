"""The error between two poses, as a kernel: tasks call it every step."""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray
from cartctl.kernels import kernel


@kernel("void(vector, matrix, vector, matrix, out_vector)")
def pose_error(p: FloatArray, R: FloatArray, p_d: FloatArray, R_d: FloatArray, error: FloatArray) -> None:
    """Fill error (6,) with ``[p_d - p; log3(R_d R^T)]``.

    The logarithm goes through the quaternion (w, x, y, z) with the largest component first (Shepperd 1978), which is
    as exact at a half turn as near the identity.
    """
    E = np.empty((3, 3))
    for i in range(3):
        error[i] = p_d[i] - p[i]
        for j in range(3):
            E[i, j] = R_d[i, 0] * R[j, 0] + R_d[i, 1] * R[j, 1] + R_d[i, 2] * R[j, 2]
    trace = E[0, 0] + E[1, 1] + E[2, 2]
    if trace >= E[0, 0] and trace >= E[1, 1] and trace >= E[2, 2]:
        w, x, y, z = 1.0 + trace, E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]
    elif E[0, 0] >= E[1, 1] and E[0, 0] >= E[2, 2]:
        w, x = E[2, 1] - E[1, 2], 1.0 + E[0, 0] - E[1, 1] - E[2, 2]
        y, z = E[0, 1] + E[1, 0], E[0, 2] + E[2, 0]
    elif E[1, 1] >= E[2, 2]:
        w, y = E[0, 2] - E[2, 0], 1.0 - E[0, 0] + E[1, 1] - E[2, 2]
        x, z = E[0, 1] + E[1, 0], E[1, 2] + E[2, 1]
    else:
        w, z = E[1, 0] - E[0, 1], 1.0 - E[0, 0] - E[1, 1] + E[2, 2]
        x, y = E[0, 2] + E[2, 0], E[1, 2] + E[2, 1]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = np.sqrt(x * x + y * y + z * z)
    factor = 2.0 / w if sine < 1e-9 * w else 2.0 * np.arctan2(sine, w) / sine
    error[3] = factor * x
    error[4] = factor * y
    error[5] = factor * z
