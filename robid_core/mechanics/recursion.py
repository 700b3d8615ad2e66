"""Mass matrix, bias torque and gravity stiffness of a chain, in one pass of O(n^2) operations.

Composite rigid bodies and recursive Newton-Euler in the world frame, spatial vectors about the world origin
(R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5 and 6). Each joint frame is turned beforehand
so that its axis is a local x, y or z. Gravity enters as an acceleration of the base; its derivative has a closed
form: a joint above turns the momentum that a unit rate of the joint below gives to what hangs on it.

A modal joint of a flexible body moves by a constant rotation and translation per unit coordinate; its body's
momentum per unit modal rate and its modal mass are constants (`Chain.modal_momentum`, `Chain.modal_mass`).
"""

from __future__ import annotations

from robid_core.compiled.functions import sine_and_cosine, sines_and_cosines
from robid_core.compiled.kernel import fused_kernel
from robid_core.compiled.lanes import like
from robid_core.compiled.views import lane_view, parameter_view, view_of
from robid_core.mechanics.chain_arrays import ChainArrays, ChainWork


@fused_kernel
def chain_views(chain, numbers, own):  # type: ignore[no-untyped-def]
    """Views of the arrays of a chain, of one set of numbers; `own` as of `parameter_view`."""
    return ChainArrays(
        view_of(chain.tree), parameter_view(chain.body[numbers], own), view_of(chain.ancestor),
        parameter_view(chain.modal[numbers], own), parameter_view(chain.modal_mass[numbers], own),
        parameter_view(chain.gravity[numbers], own),
    )  # fmt: skip


@fused_kernel
def work_views(work, single):  # type: ignore[no-untyped-def]
    """Views of the memory of one evaluation."""
    return ChainWork(
        lane_view(work.record, single), lane_view(work.screw, single), lane_view(work.momentum, single),
        lane_view(work.mass, single), lane_view(work.bias, single), lane_view(work.gravity_stiffness, single),
        lane_view(work.sine, single), lane_view(work.cosine, single),
    )  # fmt: skip


@fused_kernel
def project(chain, screw, momentum, mass):  # type: ignore[no-untyped-def]
    """Fill the lower triangle of the mass matrix: the momentum of each joint along the screws above it."""
    for j in range(chain.tree.shape[0]):
        a0, a1, a2 = momentum[0, j], momentum[1, j], momentum[2, j]
        b0, b1, b2 = momentum[3, j], momentum[4, j], momentum[5, j]
        for i in range(j + 1):
            if chain.ancestor[j, i]:
                mass[j, i] = (
                    screw[0, i] * a0 + screw[1, i] * a1 + screw[2, i] * a2
                    + screw[3, i] * b0 + screw[4, i] * b1 + screw[5, i] * b2
                )  # fmt: skip
            else:
                mass[j, i] = 0.0
        root = chain.tree[j, 3]
        if root >= 0:
            for i in range(root + 1):
                if chain.ancestor[root, i]:
                    mass[j, i] = mass[j, i] + (
                        screw[0, i] * momentum[6, j] + screw[1, i] * momentum[7, j] + screw[2, i] * momentum[8, j]
                        + screw[3, i] * momentum[9, j] + screw[4, i] * momentum[10, j] + screw[5, i] * momentum[11, j]
                    )  # fmt: skip
            for i in range(root + 1, j + 1):
                mass[j, i] = mass[j, i] + chain.modal_mass[j, i]


@fused_kernel
def project_gravity(chain, screw, momentum, stiffness):  # type: ignore[no-untyped-def]
    """Fill the lower triangle of dg/dq: gravity times linear momentum, on the axis of the joint above.

    A prismatic joint turns nothing; its axis counts as zero.
    """
    gx, gy, gz = chain.gravity[0], chain.gravity[1], chain.gravity[2]
    for j in range(chain.tree.shape[0]):
        root = chain.tree[j, 3]
        b0, b1, b2 = momentum[3, j], momentum[4, j], momentum[5, j]
        for i in range(j + 1):
            if chain.ancestor[j, i] == 0:
                stiffness[j, i] = 0.0
                continue
            if i == root + 1:  # the joints from here on do not turn the flexible body's root
                b0, b1, b2 = momentum[3, j], momentum[4, j], momentum[5, j]
            elif i == 0 and root >= 0:
                b0, b1, b2 = b0 + momentum[9, j], b1 + momentum[10, j], b2 + momentum[11, j]
            if i == j and chain.tree[j, 1] == 4:  # its own sliding turns nothing
                m = momentum[13, j]
                b0, b1, b2 = b0 - m * screw[6, j], b1 - m * screw[7, j], b2 - m * screw[8, j]
            c0, c1, c2 = gy * b2 - gz * b1, gz * b0 - gx * b2, gx * b1 - gy * b0
            stiffness[j, i] = screw[0, i] * c0 + screw[1, i] * c1 + screw[2, i] * c2


@fused_kernel
def bend(chain, record, momentum, j, deflection, rate):  # type: ignore[no-untyped-def]
    """Add what mode j does to its flexible body, all in world axes about the world's origin.

    The body's momentum for a unit modal rate goes into momentum[6:12, j]; its inertia changes by `deflection` times the
    derivative of the inertia, and so do its forces; momentum[12, j] is half the square of the root's velocity over that
    derivative, the generalised force of the changing kinetic energy.
    """
    root = chain.tree[j, 3]
    xx, xy, xz = record[root, 0], record[root, 1], record[root, 2]
    yx, yy, yz = record[root, 3], record[root, 4], record[root, 5]
    zx, zy, zz = record[root, 6], record[root, 7], record[root, 8]
    px, py, pz = record[root, 9], record[root, 10], record[root, 11]
    wx, wy, wz = record[root, 12], record[root, 13], record[root, 14]
    ux, uy, uz = record[root, 15], record[root, 16], record[root, 17]
    ax, ay, az = record[root, 18], record[root, 19], record[root, 20]
    bx, by, bz = record[root, 21], record[root, 22], record[root, 23]
    e0, e1, e2 = chain.modal[j, 0], chain.modal[j, 1], chain.modal[j, 2]
    e3, e4, e5 = chain.modal[j, 3], chain.modal[j, 4], chain.modal[j, 5]
    hx, hy, hz = e3 * xx + e4 * yx + e5 * zx, e3 * xy + e4 * yy + e5 * zy, e3 * xz + e4 * yz + e5 * zz
    kx = e0 * xx + e1 * yx + e2 * zx + py * hz - pz * hy
    ky = e0 * xy + e1 * yy + e2 * zy + pz * hx - px * hz
    kz = e0 * xz + e1 * yz + e2 * zz + px * hy - py * hx
    momentum[6, j], momentum[7, j], momentum[8, j] = kx, ky, kz
    momentum[9, j], momentum[10, j], momentum[11, j] = hx, hy, hz
    # derivative of the inertia about the world's origin: no mass, first moment h
    e0, e1, e2 = chain.modal[j, 6], chain.modal[j, 7], chain.modal[j, 8]
    e3, e4, e5 = chain.modal[j, 9], chain.modal[j, 10], chain.modal[j, 11]
    a0, a1, a2 = e0 * xx + e3 * yx + e4 * zx, e0 * xy + e3 * yy + e4 * zy, e0 * xz + e3 * yz + e4 * zz
    b0, b1, b2 = e3 * xx + e1 * yx + e5 * zx, e3 * xy + e1 * yy + e5 * zy, e3 * xz + e1 * yz + e5 * zz
    c0, c1, c2 = e4 * xx + e5 * yx + e2 * zx, e4 * xy + e5 * yy + e2 * zy, e4 * xz + e5 * yz + e2 * zz
    dx, dy, dz = 2.0 * hx * px, 2.0 * hy * py, 2.0 * hz * pz
    ixx = xx * a0 + yx * b0 + zx * c0 + dy + dz
    iyy = xy * a1 + yy * b1 + zy * c1 + dx + dz
    izz = xz * a2 + yz * b2 + zz * c2 + dx + dy
    ixy = xx * a1 + yx * b1 + zx * c1 - (hx * py + hy * px)
    ixz = xx * a2 + yx * b2 + zx * c2 - (hx * pz + hz * px)
    iyz = xy * a2 + yy * b2 + zy * c2 - (hy * pz + hz * py)
    # its momentum at the root's velocity, with that of the mode's rate
    lx = ixx * wx + ixy * wy + ixz * wz + hy * uz - hz * uy
    ly = ixy * wx + iyy * wy + iyz * wz + hz * ux - hx * uz
    lz = ixz * wx + iyz * wy + izz * wz + hx * uy - hy * ux
    gx, gy, gz = hz * wy - hy * wz, hx * wz - hz * wx, hy * wx - hx * wy
    momentum[12, j] = 0.5 * (wx * lx + wy * ly + wz * lz + ux * gx + uy * gy + uz * gz)
    mx, my, mz = deflection * lx + rate * kx, deflection * ly + rate * ky, deflection * lz + rate * kz
    nx, ny, nz = deflection * gx + rate * hx, deflection * gy + rate * hy, deflection * gz + rate * hz
    record[root, 34] = (
        record[root, 34]
        + rate * lx
        + wy * mz
        - wz * my
        + uy * nz
        - uz * ny
        + deflection * (ixx * ax + ixy * ay + ixz * az + hy * bz - hz * by)
    )
    record[root, 35] = (
        record[root, 35]
        + rate * ly
        + wz * mx
        - wx * mz
        + uz * nx
        - ux * nz
        + deflection * (ixy * ax + iyy * ay + iyz * az + hz * bx - hx * bz)
    )
    record[root, 36] = (
        record[root, 36]
        + rate * lz
        + wx * my
        - wy * mx
        + ux * ny
        - uy * nx
        + deflection * (ixz * ax + iyz * ay + izz * az + hx * by - hy * bx)
    )
    record[root, 37] = record[root, 37] + rate * gx + wy * nz - wz * ny - deflection * (hy * az - hz * ay)
    record[root, 38] = record[root, 38] + rate * gy + wz * nx - wx * nz - deflection * (hz * ax - hx * az)
    record[root, 39] = record[root, 39] + rate * gz + wx * ny - wy * nx - deflection * (hx * ay - hy * ax)
    record[root, 24] = record[root, 24] + deflection * ixx
    record[root, 25] = record[root, 25] + deflection * iyy
    record[root, 26] = record[root, 26] + deflection * izz
    record[root, 27] = record[root, 27] + deflection * ixy
    record[root, 28] = record[root, 28] + deflection * ixz
    record[root, 29] = record[root, 29] + deflection * iyz
    record[root, 30] = record[root, 30] + deflection * hx
    record[root, 31] = record[root, 31] + deflection * hy
    record[root, 32] = record[root, 32] + deflection * hz


@fused_kernel
def evaluate(chain, work, position, speed):  # type: ignore[no-untyped-def]
    """Fill the lower triangle of mass, and bias; `project_gravity` fills that of gravity_stiffness after it.

    `chain` and `work` are `ChainArrays` and `ChainWork` of views; position and speed hold the n joints first.
    """
    tree, body, gravity = chain.tree, chain.body, chain.gravity
    record, screw, momentum, bias = work.record, work.screw, work.momentum, work.bias
    n = tree.shape[0]
    sines_and_cosines(position, work.sine, work.cosine)
    zero, one = like(position[0], 0.0), like(position[0], 1.0)
    xx = xy = xz = yx = yy = yz = zx = zy = zz = zero  # axes of the parent's frame
    px = py = pz = wx = wy = wz = ux = uy = uz = ax = ay = az = bx = by = bz = zero
    for j in range(n):
        parent = tree[j, 0]
        if parent < 0:
            xx = yy = zz = one
            xy = xz = yx = yz = zx = zy = zero
            px = py = pz = wx = wy = wz = ux = uy = uz = ax = ay = az = zero
            bx, by, bz = zero - gravity[0], zero - gravity[1], zero - gravity[2]
        elif parent != j - 1:  # else the values of the joint before are still at hand
            xx, xy, xz = record[parent, 0], record[parent, 1], record[parent, 2]
            yx, yy, yz = record[parent, 3], record[parent, 4], record[parent, 5]
            zx, zy, zz = record[parent, 6], record[parent, 7], record[parent, 8]
            px, py, pz = record[parent, 9], record[parent, 10], record[parent, 11]
            wx, wy, wz = record[parent, 12], record[parent, 13], record[parent, 14]
            ux, uy, uz = record[parent, 15], record[parent, 16], record[parent, 17]
            ax, ay, az = record[parent, 18], record[parent, 19], record[parent, 20]
            bx, by, bz = record[parent, 21], record[parent, 22], record[parent, 23]
        e0, e1, e2 = body[j, 9], body[j, 10], body[j, 11]
        moved = tree[j, 6]
        if moved & 1:
            px, py, pz = px + e0 * xx, py + e0 * xy, pz + e0 * xz
        if moved & 2:
            px, py, pz = px + e1 * yx, py + e1 * yy, pz + e1 * yz
        if moved & 4:
            px, py, pz = px + e2 * zx, py + e2 * zy, pz + e2 * zz
        if tree[j, 2]:  # axes of the joint frame at coordinate zero
            r0, r1, r2 = body[j, 0], body[j, 3], body[j, 6]
            s0, s1, s2 = body[j, 1], body[j, 4], body[j, 7]
            t0, t1, t2 = body[j, 2], body[j, 5], body[j, 8]
            xx, yx, zx = r0 * xx + r1 * yx + r2 * zx, s0 * xx + s1 * yx + s2 * zx, t0 * xx + t1 * yx + t2 * zx
            xy, yy, zy = r0 * xy + r1 * yy + r2 * zy, s0 * xy + s1 * yy + s2 * zy, t0 * xy + t1 * yy + t2 * zy
            xz, yz, zz = r0 * xz + r1 * yz + r2 * zz, s0 * xz + s1 * yz + s2 * zz, t0 * xz + t1 * yz + t2 * zz
        d = speed[j]
        local = tree[j, 1]
        if local == 3:
            px, py, pz = px + position[j] * zx, py + position[j] * zy, pz + position[j] * zz
            sx = sy = sz = zero
            lx, ly, lz = zx, zy, zz
        elif local == 4:  # modal: slide by a vector, then turn about z, both in proportion to the coordinate
            e0, e1, e2, turn = body[j, 22], body[j, 23], body[j, 24], body[j, 25]
            lx, ly, lz = e0 * xx + e1 * yx + e2 * zx, e0 * xy + e1 * yy + e2 * zy, e0 * xz + e1 * yz + e2 * zz
            px, py, pz = px + position[j] * lx, py + position[j] * ly, pz + position[j] * lz
            sx, sy, sz = turn * zx, turn * zy, turn * zz
            screw[6, j], screw[7, j], screw[8, j] = lx, ly, lz
            bx += d * d * (ly * sz - lz * sy)  # the axis itself slides
            by += d * d * (lz * sx - lx * sz)
            bz += d * d * (lx * sy - ly * sx)
            lx, ly, lz = lx + py * sz - pz * sy, ly + pz * sx - px * sz, lz + px * sy - py * sx
            s, c = sine_and_cosine(turn * position[j])
            xx, xy, xz, yx, yy, yz = (
                c * xx + s * yx, c * xy + s * yy, c * xz + s * yz,
                c * yx - s * xx, c * yy - s * xy, c * yz - s * xz,
            )  # fmt: skip
        else:
            s, c = work.sine[j], work.cosine[j]
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
        if tree[j, 4]:  # somebody comes back to it
            record[j, 0], record[j, 1], record[j, 2] = xx, xy, xz
            record[j, 3], record[j, 4], record[j, 5] = yx, yy, yz
            record[j, 6], record[j, 7], record[j, 8] = zx, zy, zz
            record[j, 9], record[j, 10], record[j, 11] = px, py, pz
            record[j, 12], record[j, 13], record[j, 14] = wx, wy, wz
            record[j, 15], record[j, 16], record[j, 17] = ux, uy, uz
            record[j, 18], record[j, 19], record[j, 20] = ax, ay, az
            record[j, 21], record[j, 22], record[j, 23] = bx, by, bz
        if tree[j, 3] >= 0:
            bend(chain, record, momentum, j, position[j], d)
        m = body[j, 12]
        if tree[j, 7] == 0:
            if tree[j, 5]:
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
    # composite bodies from the last joint up, at hand in c0 to c15
    c0 = c1 = c2 = c3 = c4 = c5 = c6 = c7 = c8 = c9 = c10 = c11 = c12 = c13 = c14 = c15 = zero
    for j in range(n - 1, -1, -1):
        if j == n - 1 or tree[j + 1, 0] != j:  # nothing hangs on it but what was added to its record
            c0 = c1 = c2 = c3 = c4 = c5 = c6 = c7 = c8 = c9 = c10 = c11 = c12 = c13 = c14 = c15 = zero
        if tree[j, 5]:
            c0, c1, c2, c3 = c0 + record[j, 24], c1 + record[j, 25], c2 + record[j, 26], c3 + record[j, 27]
            c4, c5, c6, c7 = c4 + record[j, 28], c5 + record[j, 29], c6 + record[j, 30], c7 + record[j, 31]
            c8, c9, c10, c11 = (
                c8 + record[j, 32],
                c9 + record[j, 33],
                c10 + record[j, 34],
                c11 + record[j, 35],
            )
            c12, c13, c14, c15 = (
                c12 + record[j, 36],
                c13 + record[j, 37],
                c14 + record[j, 38],
                c15 + record[j, 39],
            )
        sx, sy, sz, lx, ly, lz = screw[0, j], screw[1, j], screw[2, j], screw[3, j], screw[4, j], screw[5, j]
        bias[j] = sx * c10 + sy * c11 + sz * c12 + lx * c13 + ly * c14 + lz * c15
        root = tree[j, 3]
        if root >= 0:
            bias[j] = bias[j] + (
                momentum[6, j] * record[root, 18] + momentum[7, j] * record[root, 19]
                + momentum[8, j] * record[root, 20] + momentum[9, j] * record[root, 21]
                + momentum[10, j] * record[root, 22] + momentum[11, j] * record[root, 23]
                - momentum[12, j]
            )  # fmt: skip
        momentum[0, j] = c0 * sx + c3 * sy + c4 * sz + c7 * lz - c8 * ly
        momentum[1, j] = c3 * sx + c1 * sy + c5 * sz + c8 * lx - c6 * lz
        momentum[2, j] = c4 * sx + c5 * sy + c2 * sz + c6 * ly - c7 * lx
        momentum[3, j] = c9 * lx - (c7 * sz - c8 * sy)
        momentum[4, j] = c9 * ly - (c8 * sx - c6 * sz)
        momentum[5, j] = c9 * lz - (c6 * sy - c7 * sx)
        momentum[13, j] = c9
        parent = tree[j, 0]
        if parent >= 0 and parent != j - 1:
            record[parent, 24], record[parent, 25] = record[parent, 24] + c0, record[parent, 25] + c1
            record[parent, 26], record[parent, 27] = record[parent, 26] + c2, record[parent, 27] + c3
            record[parent, 28], record[parent, 29] = record[parent, 28] + c4, record[parent, 29] + c5
            record[parent, 30], record[parent, 31] = record[parent, 30] + c6, record[parent, 31] + c7
            record[parent, 32], record[parent, 33] = record[parent, 32] + c8, record[parent, 33] + c9
            record[parent, 34], record[parent, 35] = record[parent, 34] + c10, record[parent, 35] + c11
            record[parent, 36], record[parent, 37] = record[parent, 36] + c12, record[parent, 37] + c13
            record[parent, 38], record[parent, 39] = record[parent, 38] + c14, record[parent, 39] + c15
    project(chain, screw, momentum, work.mass)
