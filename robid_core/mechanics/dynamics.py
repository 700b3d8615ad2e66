"""Mass matrix, bias torque and gravity stiffness of a chain, in one pass of O(n^2) operations.

Composite rigid bodies and recursive Newton-Euler in the world frame, spatial vectors about the world origin
(R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5 and 6). Each joint frame is turned beforehand
so that its axis is a local x, y or z. Gravity enters as an acceleration of the base; its derivative has a closed
form: a joint above turns the momentum that a unit rate of the joint below gives to what hangs on it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robid_core.mechanics.chain import Chain, FloatArray
from robid_core.mechanics.kernel import kernel
from robid_core.mechanics.layout import chain_arrays, chain_work


@dataclass(frozen=True)
class Dynamics:
    """What `dynamics` returns; leading axes are those of the position."""

    mass: FloatArray
    """(..., n, n) kg m^2 (kg for a prismatic pair)."""
    bias: FloatArray
    """(..., n) velocity dependent and gravity torque c + g of (2.1), N m or N."""
    gravity_stiffness: FloatArray
    """(..., n, n) dg/dq, symmetric."""


def dynamics(chain: Chain, position: FloatArray, speed: FloatArray | None = None) -> Dynamics:
    """Mass matrix, bias and gravity stiffness at many positions.

    Parameters
    ----------
    chain
        The mechanism.
    position
        Joint coordinates, rad or m, shape (..., n).
    speed
        Their rates, same shape; rest if left out.
    """
    q = np.array(position, dtype=np.float64, order="C")
    v = np.zeros_like(q) if speed is None else np.array(speed, dtype=np.float64, order="C")
    n = chain.n_coordinate
    rows = q.reshape(-1, n)
    mass, bias = np.zeros((len(rows), n, n)), np.zeros((len(rows), n))
    stiffness = np.zeros((len(rows), n, n))
    dynamics_rows(*chain_arrays(chain), *chain_work(n), rows, v.reshape(-1, n), mass, bias, stiffness)
    return Dynamics(mass.reshape(*q.shape, n), bias.reshape(q.shape), stiffness.reshape(*q.shape, n))


@kernel
def sine_cosine(angle, screw):  # type: ignore[no-untyped-def]
    """Sines and cosines of joint angles into screw[6] and [7]; the compiler makes vector code of it.

    Reduction by quarter turns, pi / 2 in three parts of 33 bits (Cody and Waite; fdlibm, e_rem_pio2.c), then
    the polynomials of the Cephes library (S. Moshier). Exact to 2 units in the last place for |angle| < 1e5 rad.
    """
    for j in range(screw.shape[1]):
        x = angle[j]
        quarter = math.floor(x * 0.63661977236758134308 + 0.5)
        r = (
            (x - quarter * 1.5707963267341256) - quarter * 6.0771005065061922e-11
        ) - quarter * 2.0222662487959506e-21
        z = r * r
        s = -2.50507477628578072866e-8 + z * 1.58962301576546568060e-10
        s = -1.98412698295895385996e-4 + z * (2.75573136213857245213e-6 + z * s)
        s = r + r * z * (-1.66666666666666307295e-1 + z * (8.33333333332211858878e-3 + z * s))
        c = 2.08757008419747316778e-9 - z * 1.13585365213876817300e-11
        c = 2.48015872888517045348e-5 + z * (-2.75573141792967388112e-7 + z * c)
        c = 1.0 - 0.5 * z + z * z * (4.16666666666665929218e-2 + z * (-1.38888888888730564116e-3 + z * c))
        turned = quarter - 4.0 * math.floor(0.25 * quarter)  # 0, 1, 2, 3
        odd = turned == 1.0 or turned == 3.0
        a = c if odd else s
        b = s if odd else c
        screw[6, j] = -a if turned >= 2.0 else a
        screw[7, j] = -b if turned == 1.0 or turned == 2.0 else b


@kernel
def project(screw, momentum, ancestor, mass):  # type: ignore[no-untyped-def]
    """Fill the lower triangle of the mass matrix: the momentum of each joint along the screws above it."""
    for j in range(screw.shape[1]):
        a0, a1, a2 = momentum[0, j], momentum[1, j], momentum[2, j]
        b0, b1, b2 = momentum[3, j], momentum[4, j], momentum[5, j]
        for i in range(j + 1):
            mass[j, i] = ancestor[j, i] * (
                screw[0, i] * a0 + screw[1, i] * a1 + screw[2, i] * a2
                + screw[3, i] * b0 + screw[4, i] * b1 + screw[5, i] * b2
            )  # fmt: skip


@kernel
def project_gravity(screw, momentum, ancestor, gravity, stiffness):  # type: ignore[no-untyped-def]
    """Fill the lower triangle of dg/dq: gravity times linear momentum, on the axis of the joint above.

    A prismatic joint turns nothing; its axis counts as zero.
    """
    for j in range(screw.shape[1]):
        b0, b1, b2 = momentum[3, j], momentum[4, j], momentum[5, j]
        c0 = gravity[1] * b2 - gravity[2] * b1
        c1 = gravity[2] * b0 - gravity[0] * b2
        c2 = gravity[0] * b1 - gravity[1] * b0
        for i in range(j + 1):
            stiffness[j, i] = ancestor[j, i] * (screw[0, i] * c0 + screw[1, i] * c1 + screw[2, i] * c2)


@kernel
def evaluate(  # type: ignore[no-untyped-def]
    tree, body, ancestor, gravity, record, screw, momentum, mass, bias, gravity_stiffness, position, speed, stiff,
):  # fmt: skip
    """Fill the lower triangle of mass, bias, and where `stiff` the lower triangle of gravity_stiffness.

    The first ten arguments are the fields of `ChainArrays` and `ChainWork`; position and speed
    hold the n joints first.
    """
    n = tree.shape[0]
    sine_cosine(position, screw)
    xx = xy = xz = yx = yy = yz = zx = zy = zz = 0.0  # axes of the parent's frame
    px = py = pz = wx = wy = wz = ux = uy = uz = ax = ay = az = bx = by = bz = 0.0
    for j in range(n):
        parent = tree[j, 0]
        if parent < 0:
            xx = yy = zz = 1.0
            xy = xz = yx = yz = zx = zy = 0.0
            px = py = pz = wx = wy = wz = ux = uy = uz = ax = ay = az = 0.0
            bx, by, bz = -gravity[0], -gravity[1], -gravity[2]
        elif parent != j - 1:  # else the values of the joint before are still at hand
            xx, xy, xz = record[parent, 0], record[parent, 1], record[parent, 2]
            yx, yy, yz = record[parent, 3], record[parent, 4], record[parent, 5]
            zx, zy, zz = record[parent, 6], record[parent, 7], record[parent, 8]
            px, py, pz = record[parent, 9], record[parent, 10], record[parent, 11]
            wx, wy, wz = record[parent, 12], record[parent, 13], record[parent, 14]
            ux, uy, uz = record[parent, 15], record[parent, 16], record[parent, 17]
            ax, ay, az = record[parent, 18], record[parent, 19], record[parent, 20]
            bx, by, bz = record[parent, 21], record[parent, 22], record[parent, 23]
        px, py, pz = (
            px + body[j, 9] * xx + body[j, 10] * yx + body[j, 11] * zx,
            py + body[j, 9] * xy + body[j, 10] * yy + body[j, 11] * zy,
            pz + body[j, 9] * xz + body[j, 10] * yz + body[j, 11] * zz,
        )
        if tree[j, 2]:  # axes of the joint frame at coordinate zero
            r0, r1, r2 = body[j, 0], body[j, 3], body[j, 6]
            s0, s1, s2 = body[j, 1], body[j, 4], body[j, 7]
            t0, t1, t2 = body[j, 2], body[j, 5], body[j, 8]
            xx, yx, zx = r0 * xx + r1 * yx + r2 * zx, s0 * xx + s1 * yx + s2 * zx, t0 * xx + t1 * yx + t2 * zx
            xy, yy, zy = r0 * xy + r1 * yy + r2 * zy, s0 * xy + s1 * yy + s2 * zy, t0 * xy + t1 * yy + t2 * zy
            xz, yz, zz = r0 * xz + r1 * yz + r2 * zz, s0 * xz + s1 * yz + s2 * zz, t0 * xz + t1 * yz + t2 * zz
        d, s, c = speed[j], screw[6, j], screw[7, j]
        local = tree[j, 1]
        if local == 3:
            px, py, pz = px + position[j] * zx, py + position[j] * zy, pz + position[j] * zz
            sx = sy = sz = 0.0
            lx, ly, lz = zx, zy, zz
        else:
            if local == 0:
                sx, sy, sz = xx, xy, xz
                yx, yy, yz, zx, zy, zz = (
                    c * yx + s * zx, c * yy + s * zy, c * yz + s * zz,
                    c * zx - s * yx, c * zy - s * yy, c * zz - s * yz,
                )  # fmt: skip
            elif local == 1:
                sx, sy, sz = yx, yy, yz
                zx, zy, zz, xx, xy, xz = (
                    c * zx + s * xx, c * zy + s * xy, c * zz + s * xz,
                    c * xx - s * zx, c * xy - s * zy, c * xz - s * zz,
                )  # fmt: skip
            else:
                sx, sy, sz = zx, zy, zz
                xx, xy, xz, yx, yy, yz = (
                    c * xx + s * yx, c * xy + s * yy, c * xz + s * yz,
                    c * yx - s * xx, c * yy - s * xy, c * yz - s * xz,
                )  # fmt: skip
            lx, ly, lz = py * sz - pz * sy, pz * sx - px * sz, px * sy - py * sx
        # the screw moves with the parent: its rate is the parent's velocity times the screw
        ax += d * (wy * sz - wz * sy)
        ay += d * (wz * sx - wx * sz)
        az += d * (wx * sy - wy * sx)
        bx += d * (wy * lz - wz * ly + uy * sz - uz * sy)
        by += d * (wz * lx - wx * lz + uz * sx - ux * sz)
        bz += d * (wx * ly - wy * lx + ux * sy - uy * sx)
        wx, wy, wz = wx + d * sx, wy + d * sy, wz + d * sz
        ux, uy, uz = ux + d * lx, uy + d * ly, uz + d * lz
        screw[0, j], screw[1, j], screw[2, j], screw[3, j], screw[4, j], screw[5, j] = sx, sy, sz, lx, ly, lz
        record[j, 0], record[j, 1], record[j, 2] = xx, xy, xz
        record[j, 3], record[j, 4], record[j, 5] = yx, yy, yz
        record[j, 6], record[j, 7], record[j, 8] = zx, zy, zz
        record[j, 9], record[j, 10], record[j, 11] = px, py, pz
        record[j, 12], record[j, 13], record[j, 14] = wx, wy, wz
        record[j, 15], record[j, 16], record[j, 17] = ux, uy, uz
        record[j, 18], record[j, 19], record[j, 20] = ax, ay, az
        record[j, 21], record[j, 22], record[j, 23] = bx, by, bz
        m = body[j, 12]
        if m == 0.0:
            for k in range(24, 40):
                record[j, k] = 0.0
            continue
        # mass times centre from the joint's origin, then inertia in world axes about the joint's origin
        o0, o1, o2 = body[j, 13], body[j, 14], body[j, 15]
        e0, e1, e2, e3, e4, e5 = body[j, 16], body[j, 17], body[j, 18], body[j, 19], body[j, 20], body[j, 21]
        hx = o0 * xx + o1 * yx + o2 * zx
        hy = o0 * xy + o1 * yy + o2 * zy
        hz = o0 * xz + o1 * yz + o2 * zz
        a0, a1, a2 = e0 * xx + e3 * yx + e4 * zx, e0 * xy + e3 * yy + e4 * zy, e0 * xz + e3 * yz + e4 * zz
        b0, b1, b2 = e3 * xx + e1 * yx + e5 * zx, e3 * xy + e1 * yy + e5 * zy, e3 * xz + e1 * yz + e5 * zz
        c0, c1, c2 = e4 * xx + e5 * yx + e2 * zx, e4 * xy + e5 * yy + e2 * zy, e4 * xz + e5 * yz + e2 * zz
        # about the world's origin: the joint's origin p moves it by (2 h + m p) . p, the centre by m p
        qx, qy, qz = hx + m * px, hy + m * py, hz + m * pz
        dx, dy, dz = (hx + qx) * px, (hy + qy) * py, (hz + qz) * pz
        ixx = xx * a0 + yx * b0 + zx * c0 + dy + dz
        iyy = xy * a1 + yy * b1 + zy * c1 + dx + dz
        izz = xz * a2 + yz * b2 + zz * c2 + dx + dy
        ixy = xx * a1 + yx * b1 + zx * c1 - (hx * py + qy * px)
        ixz = xx * a2 + yx * b2 + zx * c2 - (hx * pz + qz * px)
        iyz = xy * a2 + yy * b2 + zy * c2 - (hy * pz + qz * py)
        record[j, 24], record[j, 25], record[j, 26] = ixx, iyy, izz
        record[j, 27], record[j, 28], record[j, 29] = ixy, ixz, iyz
        record[j, 30], record[j, 31], record[j, 32], record[j, 33] = qx, qy, qz, m
        # angular and linear momentum, then their rates
        kx = ixx * wx + ixy * wy + ixz * wz + qy * uz - qz * uy
        ky = ixy * wx + iyy * wy + iyz * wz + qz * ux - qx * uz
        kz = ixz * wx + iyz * wy + izz * wz + qx * uy - qy * ux
        gx = m * ux - (qy * wz - qz * wy)
        gy = m * uy - (qz * wx - qx * wz)
        gz = m * uz - (qx * wy - qy * wx)
        record[j, 34] = (
            ixx * ax + ixy * ay + ixz * az + qy * bz - qz * by + wy * kz - wz * ky + uy * gz - uz * gy
        )
        record[j, 35] = (
            ixy * ax + iyy * ay + iyz * az + qz * bx - qx * bz + wz * kx - wx * kz + uz * gx - ux * gz
        )
        record[j, 36] = (
            ixz * ax + iyz * ay + izz * az + qx * by - qy * bx + wx * ky - wy * kx + ux * gy - uy * gx
        )
        record[j, 37] = m * bx - (qy * az - qz * ay) + wy * gz - wz * gy
        record[j, 38] = m * by - (qz * ax - qx * az) + wz * gx - wx * gz
        record[j, 39] = m * bz - (qx * ay - qy * ax) + wx * gy - wy * gx
    for j in range(n - 1, -1, -1):
        sx, sy, sz, lx, ly, lz = screw[0, j], screw[1, j], screw[2, j], screw[3, j], screw[4, j], screw[5, j]
        ixx, iyy, izz = record[j, 24], record[j, 25], record[j, 26]
        ixy, ixz, iyz = record[j, 27], record[j, 28], record[j, 29]
        qx, qy, qz, m = record[j, 30], record[j, 31], record[j, 32], record[j, 33]
        bias[j] = (
            sx * record[j, 34] + sy * record[j, 35] + sz * record[j, 36]
            + lx * record[j, 37] + ly * record[j, 38] + lz * record[j, 39]
        )  # fmt: skip
        momentum[0, j] = ixx * sx + ixy * sy + ixz * sz + qy * lz - qz * ly
        momentum[1, j] = ixy * sx + iyy * sy + iyz * sz + qz * lx - qx * lz
        momentum[2, j] = ixz * sx + iyz * sy + izz * sz + qx * ly - qy * lx
        momentum[3, j] = m * lx - (qy * sz - qz * sy)
        momentum[4, j] = m * ly - (qz * sx - qx * sz)
        momentum[5, j] = m * lz - (qx * sy - qy * sx)
        parent = tree[j, 0]
        if parent >= 0:
            for k in range(24, 40):
                record[parent, k] += record[j, k]
    project(screw, momentum, ancestor, mass)
    if stiff:
        project_gravity(screw, momentum, ancestor, gravity, gravity_stiffness)


@kernel
def dynamics_rows(  # type: ignore[no-untyped-def]
    tree, body, ancestor, gravity, record, screw, momentum, mass, bias, stiffness, position, speed,
    masses, biases, stiffnesses,
):  # fmt: skip
    """Evaluate every row of position and speed into full symmetric matrices."""
    n = position.shape[1]
    for row in range(position.shape[0]):
        evaluate(
            tree, body, ancestor, gravity, record, screw, momentum, mass, bias, stiffness,
            position[row], speed[row], True,
        )  # fmt: skip
        for i in range(n):
            biases[row, i] = bias[i]
            for j in range(i + 1):
                masses[row, i, j] = masses[row, j, i] = mass[i, j]
                stiffnesses[row, i, j] = stiffnesses[row, j, i] = stiffness[i, j]
