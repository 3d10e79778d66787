"""Independent answers: other formulas, other libraries, random problems whose answer is known or easy.

Nothing here imports cartctl's solvers or algebra: what they compute is computed again in another way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from hypothesis import strategies as st
from scipy.linalg import null_space

SEEDS = st.integers(0, 2**32 - 1)


def magnitudes(low, high):
    """Numbers of every order of magnitude from low to high alike."""
    return st.floats(math.log10(low), math.log10(high)).map(lambda exponent: 10.0**exponent)


GAP = 1e-8  # ranks of the random problems below are clear: singular values are above 0.1 or round-off


# ---------------------------------------------------------------- random problems


def matrix_with(rng, m, n, s):
    """A (m, n) with the singular values s (r,), r <= min(m, n), and zeros beyond."""
    U = np.linalg.qr(rng.normal(size=(m, m)))[0] if m else np.zeros((0, 0))
    V = np.linalg.qr(rng.normal(size=(n, n)))[0]
    r = len(s)
    return (U[:, :r] * np.asarray(s)) @ V[:, :r].T


def matrix(rng, m, n, rank=None):
    """A random A (m, n), well-conditioned on its range."""
    rank = min(m, n) if rank is None else min(rank, m, n)
    return matrix_with(rng, m, n, rng.uniform(0.3, 3.0, rank))


def metric(rng, n, kind):
    """None, a diagonal (n,), or a full (n, n) metric."""
    if kind == "identity":
        return None
    if kind == "diagonal":
        return rng.uniform(0.3, 3.0, n)
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    W = (Q * rng.uniform(0.3, 3.0, n)) @ Q.T
    return (W + W.T) / 2.0


METRICS = st.sampled_from(["identity", "diagonal", "full"])


def full_metric(W, n):
    """W as an (n, n) matrix, whatever form it came in."""
    if W is None:
        return np.eye(n)
    return np.diag(W) if np.ndim(W) == 1 else np.asarray(W)


@st.composite
def systems(draw, max_n=12, levels=1, deficient=True):
    """``(rng, [A_1, ...], [c_1, ...])``: any shape, m < n, m = n, m > n, m = 0, any rank, conflicts, repetitions."""
    rng = np.random.default_rng(draw(SEEDS))
    n = draw(st.integers(1, max_n))
    matrices, commands = [], []
    for k in range(draw(st.integers(1, levels)) if levels > 1 else 1):
        m = draw(st.integers(0, n + 2))
        rank = draw(st.integers(0, min(m, n))) if deficient and draw(st.booleans()) else None
        A = matrix(rng, m, n, rank)
        if k and m and draw(st.booleans()):  # depends on a task above: an algorithmic singularity
            above = matrices[int(rng.integers(k))]
            A = rng.normal(size=(m, above.shape[0])) @ above if above.shape[0] else A
            size = np.linalg.norm(A)
            A = A / size if size > GAP else A
        matrices.append(A)
        commands.append(rng.normal(size=m))
    return rng, matrices, commands


# ---------------------------------------------------------------- solves


def constrained_minimum(A, c, W=None, u0=None):
    """The u of least ``||u - u0||_W`` among the least-squares answers to ``A u = c``, from one KKT system.

    The constraint is the part of ``A u = c`` inside the range of A, r = rank A independent rows.
    """
    n = A.shape[1]
    W = full_metric(W, n)
    u0 = np.zeros(n) if u0 is None else np.asarray(u0)
    if 0 in A.shape:
        return u0
    U = np.linalg.svd(A)[0][:, : np.linalg.matrix_rank(A, tol=GAP)]
    B = U.T @ A
    r = B.shape[0]
    kkt = np.block([[W, B.T], [B, np.zeros((r, r))]])
    return np.linalg.solve(kkt, np.concatenate([W @ u0, U.T @ c]))[:n]


def lexicographic(matrices, commands, W=None, u0=None):
    """Least squares level by level inside what the levels above leave, then the least ``||u - u0||_W``.

    No projector and no pseudo-inverse of a product: each level is ``min ||A_k (u + N y) - c_k||`` over y, N a null
    space of the *stacked* levels above from SciPy.
    """
    n = matrices[0].shape[1]
    u = np.zeros(n)
    stacked = np.zeros((0, n))
    for A, c in zip(matrices, commands, strict=True):
        N = null_space(stacked, rcond=GAP) if stacked.shape[0] else np.eye(n)
        if N.shape[1] == 0:
            break
        if A.shape[0]:
            AN = A @ N
            AN[np.abs(AN) < GAP] = 0.0
            u = u + N @ np.linalg.lstsq(AN, c - A @ u, rcond=GAP)[0]
        stacked = np.vstack([stacked, A])
    return constrained_minimum(stacked, stacked @ u, W, u0)


def damped(A, c, lam, W=None, u0=None):
    """``argmin ||A u - c||^2 + lam^2 ||u||_W^2``, as least squares of a taller matrix, plus u0 in the null space."""
    n = A.shape[1]
    root = np.linalg.cholesky(full_metric(W, n)).T
    u = np.linalg.lstsq(np.vstack([A, lam * root]), np.concatenate([c, np.zeros(n)]), rcond=None)[0]
    return u if u0 is None else u + constrained_minimum(A, np.zeros(A.shape[0]), W, u0)


def size(array):
    """The Frobenius norm, at any magnitude: ``np.linalg.norm`` squares."""
    return math.hypot(*np.ravel(array).tolist())


def residual(equation, u, s=1.0):
    """``||A u + d - s b||`` element by element, without a matrix product."""
    total = 0.0
    for i in range(equation.A.shape[0]):
        row = sum(float(a) * float(x) for a, x in zip(equation.A[i], u, strict=True))
        row += 0.0 if equation.drift is None else float(equation.drift[i])
        total += (row - s * float(equation.b[i])) ** 2
    return total**0.5


# ---------------------------------------------------------------- rotations and Jacobians


def skew(a):
    """From the definition ``S(a) e_j = a x e_j``."""
    return np.column_stack([np.cross(a, e) for e in np.eye(3)])


def rotation(axis, angle):
    """Through the quaternion, not Rodrigues."""
    x, y, z = np.sin(angle / 2.0) * np.asarray(axis)
    return pin.Quaternion(float(np.cos(angle / 2.0)), float(x), float(y), float(z)).matrix()


def random_rotation(rng):
    """A rotation, uniformly distributed."""
    x, y, z, w = rng.normal(size=4)
    return pin.Quaternion(w, x, y, z).normalized().matrix()


@dataclass(frozen=True)
class Joint:
    """A joint of a chain: where it sits on the link before it, what it does there."""

    kind: str  # "revolute" or "prismatic"
    axis: np.ndarray  # (3,) unit, in the joint's own frame
    R: np.ndarray  # (3, 3) placement on the link before
    p: np.ndarray  # (3,)


def chain_jacobian(joints, tool_R, tool_p, q):
    """The Jacobian (6, n) of a serial chain, origin at the tool, world axes, by velocity conversion.

    ``v_tool = V_j v_j`` with the conversion V_j = [[R^T, -R^T S(p)], [0, R^T]] from the moved joint frame j, whose
    twist is the joint's axis, linear for a prismatic joint and angular for a revolute one; then the columns are
    turned from tool into world axes.
    """
    poses = []  # of each joint frame, after its own motion, in the world
    R, p = np.eye(3), np.zeros(3)
    for joint, value in zip(joints, q, strict=True):
        R, p = R @ joint.R, p + R @ joint.p
        if joint.kind == "revolute":
            R = R @ rotation(joint.axis, value)
        else:
            p = p + R @ (joint.axis * value)
        poses.append((R, p))
    R_tool, p_tool = R @ tool_R, p + R @ tool_p
    columns = []
    for joint, (R_j, p_j) in zip(joints, poses, strict=True):
        R_rel, p_rel = R_j.T @ R_tool, R_j.T @ (p_tool - p_j)  # the tool in joint frame j
        V = np.zeros((6, 6))
        V[:3, :3] = V[3:, 3:] = R_rel.T
        V[:3, 3:] = -R_rel.T @ skew(p_rel)
        twist = np.zeros(6)
        twist[3:] = joint.axis if joint.kind == "revolute" else 0.0
        twist[:3] = joint.axis if joint.kind == "prismatic" else 0.0
        columns.append(V @ twist)
    return np.kron(np.eye(2), R_tool) @ np.column_stack(columns)


def random_chain(rng, n):
    """``(joints, tool_R, tool_p)`` of n joints, revolute or prismatic about any axis, placed anywhere."""
    joints = []
    for _ in range(n):
        axis = rng.normal(size=3)
        kind = "revolute" if rng.random() < 0.6 else "prismatic"
        joints.append(Joint(kind, axis / np.linalg.norm(axis), random_rotation(rng), rng.uniform(-0.5, 0.5, 3)))
    return joints, random_rotation(rng), rng.uniform(-0.3, 0.3, 3)


def pinocchio_chain(joints, tool_R, tool_p):
    """The same chain as a Pinocchio model, its tool a frame called ``tool``."""
    kinds = {"revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned}
    model, parent = pin.Model(), 0
    for k, joint in enumerate(joints):
        parent = model.addJoint(parent, kinds[joint.kind](joint.axis), pin.SE3(joint.R, joint.p), f"joint_{k}")
    model.addFrame(pin.Frame("tool", parent, pin.SE3(tool_R, tool_p), pin.FrameType.OP_FRAME))
    return model


def planar_jacobian(lengths, q, point=None):
    """The (2, n) position Jacobian of a planar arm's tip, or of the end of link ``point`` (1-based)."""
    n = len(q)
    reach = n if point is None else point
    absolute = np.cumsum(q)
    J = np.zeros((2, n))
    for j in range(reach):
        for i in range(j, reach):
            J[0, j] -= lengths[i] * np.sin(absolute[i])
            J[1, j] += lengths[i] * np.cos(absolute[i])
    return J


def planar_point(lengths, q, point=None):
    """Where the tip, or the end of link ``point``, of a planar arm is, (2,)."""
    reach = len(q) if point is None else point
    absolute = np.cumsum(q)[:reach]
    return np.array([np.dot(lengths[:reach], np.cos(absolute)), np.dot(lengths[:reach], np.sin(absolute))])
