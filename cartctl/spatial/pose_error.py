"""The error between two poses, as a kernel: tasks call it every step."""

from __future__ import annotations

import numpy as np

from cartctl.checks import FloatArray
from cartctl.kernels import kernel, lean_part


@kernel("void(vector, matrix, vector, matrix, out_vector)")
def pose_error(p: FloatArray, R: FloatArray, p_d: FloatArray, R_d: FloatArray, error: FloatArray) -> None:
    """Fill error (6,) with ``[p_d - p; log3(R_d R^T)]``."""
    for i in range(3):
        error[i] = p_d[i] - p[i]
    error[3], error[4], error[5] = logarithm(
        R_d[0, 0] * R[0, 0] + R_d[0, 1] * R[0, 1] + R_d[0, 2] * R[0, 2],
        R_d[0, 0] * R[1, 0] + R_d[0, 1] * R[1, 1] + R_d[0, 2] * R[1, 2],
        R_d[0, 0] * R[2, 0] + R_d[0, 1] * R[2, 1] + R_d[0, 2] * R[2, 2],
        R_d[1, 0] * R[0, 0] + R_d[1, 1] * R[0, 1] + R_d[1, 2] * R[0, 2],
        R_d[1, 0] * R[1, 0] + R_d[1, 1] * R[1, 1] + R_d[1, 2] * R[1, 2],
        R_d[1, 0] * R[2, 0] + R_d[1, 1] * R[2, 1] + R_d[1, 2] * R[2, 2],
        R_d[2, 0] * R[0, 0] + R_d[2, 1] * R[0, 1] + R_d[2, 2] * R[0, 2],
        R_d[2, 0] * R[1, 0] + R_d[2, 1] * R[1, 1] + R_d[2, 2] * R[1, 2],
        R_d[2, 0] * R[2, 0] + R_d[2, 1] * R[2, 1] + R_d[2, 2] * R[2, 2],
    )


@lean_part
def logarithm(
    xx: float, xy: float, xz: float, yx: float, yy: float, yz: float, zx: float, zy: float, zz: float
) -> tuple[float, float, float]:
    """The angle-axis vector of a rotation, row by row.

    It goes through the quaternion (w, x, y, z) with the largest component first (Shepperd 1978), which is as exact at a
    half turn as near the identity.
    """
    trace = xx + yy + zz
    if trace >= xx and trace >= yy and trace >= zz:
        w, x, y, z = 1.0 + trace, zy - yz, xz - zx, yx - xy
    elif xx >= yy and xx >= zz:
        w, x, y, z = zy - yz, 1.0 + xx - yy - zz, xy + yx, xz + zx
    elif yy >= zz:
        w, x, y, z = xz - zx, xy + yx, 1.0 - xx + yy - zz, yz + zy
    else:
        w, x, y, z = yx - xy, xz + zx, yz + zy, 1.0 - xx - yy + zz
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = np.sqrt(x * x + y * y + z * z)
    factor = 2.0 / w if sine < 1e-9 * w else 2.0 * np.arctan2(sine, w) / sine
    return factor * x, factor * y, factor * z
