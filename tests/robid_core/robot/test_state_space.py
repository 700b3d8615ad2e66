"""The linear model as a file: what MATLAB and python-control would read is the robot's own, and means what it says."""

from __future__ import annotations

import io

import numpy as np
import pytest
import scipy.io
from scipy.linalg import eigh

from robid_core import ConfigurationError, Robot
from robid_core.robot.state_space import state_space_file

ANGLE = np.array([0.3, -0.7, 0.9, 0.2, -0.4, 0.6])


def test_eigenvalues_are_those_of_the_second_order_model() -> None:
    """Without damping and about rest they are +-i times the roots of K - w^2 M; with it, of the quadratic pencil."""
    robot = Robot.load("universal_arm")
    read = scipy.io.loadmat(io.BytesIO(state_space_file(robot, ANGLE, ".mat")))
    model = robot.second_order(ANGLE[None])
    m, d, k = model.mass[0], model.damping[0], model.stiffness[0]
    n = len(m)
    pencil = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(m, k), -np.linalg.solve(m, d)]])
    found, expected = np.linalg.eigvals(read["A"]), np.linalg.eigvals(pencil)
    order = [int(np.argmin(abs(found - value))) for value in expected]
    assert sorted(order) == list(range(2 * n))
    np.testing.assert_allclose(found[order], expected, rtol=0, atol=1e-6 * abs(expected).max())
    undamped = np.sqrt(np.maximum(eigh(k, m, eigvals_only=True), 0))[-1]
    assert abs(found).max() == pytest.approx(undamped, rel=1e-3)


def test_the_response_from_the_file_is_the_robots() -> None:
    """C (i w - A)^-1 B + D against the condensed second-order form of the kernel; the same file for both programs."""
    robot = Robot.load("scara")
    angle, frequency = np.array([0.3, -0.7, -0.1, 0.5]), np.array([5.0, 17.0, 40.0])
    ours = robot.response(angle[None], frequency, hold="continuous")[0]
    mat = scipy.io.loadmat(io.BytesIO(state_space_file(robot, angle, ".mat", ("motor_acceleration",))))
    npz = np.load(io.BytesIO(state_space_file(robot, angle, ".npz", ("motor_acceleration",))))
    for read in (mat, npz):
        for line, hertz in enumerate(frequency):
            resolvent = np.linalg.inv(2j * np.pi * hertz * np.eye(len(read["A"])) - read["A"])
            theirs = read["C"] @ resolvent @ read["B"] + read["D"]
            np.testing.assert_allclose(theirs, ours[line], rtol=0, atol=1e-9 * abs(ours[line]).max())
        assert np.ravel(read["sample_time"]).tolist() == [0.0]
        np.testing.assert_array_equal(np.ravel(read["angle"]), angle)
        np.testing.assert_allclose(np.ravel(read["torque"]), robot.gravity_torque(angle[None])[0])
    assert [str(cell[0]) for cell in mat["input_names"].ravel()] == [f"torque.axis_{i}" for i in (1, 2, 3, 4)]
    assert npz["output_names"].tolist() == [f"motor_acceleration.axis_{i}" for i in (1, 2, 3, 4)]
    assert len(npz["state_names"]) == len(npz["A"]) == len(mat["state_names"].ravel())


def test_what_cannot_be_written_is_told() -> None:
    robot = Robot.load("scara")
    with pytest.raises(
        ConfigurationError, match=r"scara has 4 axes \(axis_1, .*the configuration has 6 numbers"
    ):
        state_space_file(robot, ANGLE, ".mat")
    with pytest.raises(ConfigurationError, match="goes into .mat or .npz, not into '.txt'"):
        state_space_file(robot, np.zeros(4), ".txt")
    with pytest.raises(ConfigurationError, match="no output 'motor_torque'"):
        state_space_file(robot, np.zeros(4), ".mat", ("motor_torque",))
