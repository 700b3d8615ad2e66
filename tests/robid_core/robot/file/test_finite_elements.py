"""Finite-element files: what is written is read again, and what is wrong is told with its place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from robid_core.errors import ConfigurationError
from robid_core.mechanics.flexible import flexible_body, hollow_square
from robid_core.robot.file.finite_elements import read_structure, write_structure
from robid_core.robot.file.matrix_market import read_matrix_market

BEAM = hollow_square(0.9, 0.06, 0.004)
FORMATS = ("link.npz", "link.mat", "link_M.mtx")


def _dense(matrix: Any) -> np.ndarray:
    return matrix.toarray() if scipy.sparse.issparse(matrix) else matrix


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("name", FORMATS)
def test_what_is_written_is_read_again_to_the_last_bit(tmp_path: Path, name: str, sparse: bool) -> None:
    structure = BEAM.structure(5, sparse)
    write_structure(tmp_path / name, structure)
    again = read_structure(tmp_path / name)
    np.testing.assert_array_equal(again.nodes, structure.nodes)
    for one, other in ((again.mass, structure.mass), (again.stiffness, structure.stiffness)):
        assert scipy.sparse.issparse(one) == sparse
        np.testing.assert_array_equal(_dense(one), _dense(other))
    assert again.name == name


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_in_millimetres_and_tonnes_gives_the_same_link(tmp_path: Path, name: str) -> None:
    # the same beam made of numbers in mm, tonne, N, s: E in N/mm^2, density in t/mm^3
    small = hollow_square(900.0, 60.0, 4.0, modulus=2.1e5, density=7.85e-9).structure(5)
    write_structure(tmp_path / name, small)
    expected, found = BEAM.structure(5), read_structure(tmp_path / name, units="mm_t_s")
    np.testing.assert_allclose(found.nodes, expected.nodes, atol=1e-15)
    np.testing.assert_allclose(found.mass, expected.mass, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(found.stiffness, expected.stiffness, rtol=1e-9, atol=1e-3)
    body = flexible_body(found, 0, 5)
    assert body.mass == pytest.approx(BEAM.mass)
    with pytest.raises(ConfigurationError, match=r"nodes span 900 m .*units: mm_t_s"):
        read_structure(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "key"),
    [(name, key) for name in FORMATS for key in ("M", "K", "nodes") if (name, key) != ("link_M.mtx", "M")],
)
def test_a_missing_matrix_is_named(tmp_path: Path, name: str, key: str) -> None:
    structure = BEAM.structure(1)
    write_structure(tmp_path / name, structure)
    data = {"M": structure.mass, "K": structure.stiffness, "nodes": structure.nodes}
    del data[key]
    if name.endswith(".npz"):
        np.savez(tmp_path / name, **data)
    elif name.endswith(".mat"):
        scipy.io.savemat(tmp_path / name, data)
    else:
        (tmp_path / f"link_{key}.mtx").unlink()
    with pytest.raises(ConfigurationError, match=rf"{name}: no {key} in it; a structure has M, K and nodes"):
        read_structure(tmp_path / name)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            {"M": np.eye(6)},
            r"mass matrix M has shape \(6, 6\), but 2 nodes .* need \(12, 12\); it has 3 a node",
        ),
        (
            {"K": np.eye(11)},
            r"stiffness matrix K has shape \(11, 11\).* constrained degrees of freedom left out",
        ),
        ({"K": np.eye(18)}, r"stiffness matrix K has shape \(18, 18\).* nodes missing"),
        ({"K": np.triu(BEAM.structure(1).stiffness)}, "stiffness matrix K is not symmetric.*one triangle"),
        ({"M": -np.eye(12)}, "mass matrix M is not positive semidefinite"),
        ({"K": np.full((12, 12), np.nan)}, "stiffness matrix K holds a number that is not finite"),
        ({"M": np.array(["a"] * 144).reshape(12, 12)}, "mass matrix M is not a matrix of real numbers"),
        ({"M": np.zeros(12)}, "mass matrix M has 1 dimensions"),
        ({"nodes": np.zeros((2, 2))}, r"nodes has shape \(2, 2\)"),
        ({"nodes": np.array([["a", "b", "c"]] * 2)}, "nodes has shape"),
        ({"nodes": np.full((2, 3), np.inf)}, "nodes need shape .* finite"),
        ({"M": 1e6 * BEAM.structure(1).mass}, r"nodes span 0\.9 m and the mass is 6\.\d+e\+06 kg"),
    ],
)
def test_matrices_that_describe_no_link_are_refused(
    tmp_path: Path, change: dict[str, Any], told: str
) -> None:
    structure = BEAM.structure(1)
    data = {"M": structure.mass, "K": structure.stiffness, "nodes": structure.nodes}
    np.savez(tmp_path / "link.npz", **(data | change))
    with pytest.raises(ConfigurationError, match=rf"link\.npz: {told}"):
        read_structure(tmp_path / "link.npz")


def test_objects_in_a_file_are_never_unpickled(tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> tuple[Any, ...]:
            return (pytest.fail, ("unpickled",))

    np.savez(tmp_path / "link.npz", M=np.array([Trap()], dtype=object))
    with pytest.raises(
        ConfigurationError, match=r"link\.npz: cannot be read: Object arrays cannot be loaded"
    ):
        read_structure(tmp_path / "link.npz")


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("content", [b"", b"no matrix at all", bytes(range(256)) * 4])
def test_a_damaged_file_is_told_without_a_traceback(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ConfigurationError, match=name):
        read_structure(tmp_path / name)


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_cut_short_is_told_without_a_traceback(tmp_path: Path, name: str) -> None:
    write_structure(tmp_path / name, BEAM.structure(2, sparse=True))
    whole = (tmp_path / name).read_bytes()
    for share in (0.2, 0.5, 0.9):
        (tmp_path / name).write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(ConfigurationError, match=name):
            read_structure(tmp_path / name)


def test_sparse_entries_outside_the_matrix_are_refused(tmp_path: Path) -> None:
    write_structure(tmp_path / "link.npz", BEAM.structure(2, sparse=True))
    data = dict(np.load(tmp_path / "link.npz"))
    data["M_row"] = data["M_row"] + 1
    np.savez(tmp_path / "link.npz", **data)
    with pytest.raises(ConfigurationError, match=r"link\.npz: cannot be read"):
        read_structure(tmp_path / "link.npz")


def test_unknown_formats_and_files_that_are_not_there_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="is no file"):
        read_structure(tmp_path / "link.npz")
    (tmp_path / "link.op2").write_bytes(b"x")
    with pytest.raises(ConfigurationError, match=r"link\.op2: no format of this name"):
        read_structure(tmp_path / "link.op2")
    with pytest.raises(ConfigurationError, match="no format of this name"):
        write_structure(tmp_path / "link.mtx", BEAM.structure(1))
    header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    (tmp_path / "link.mat").write_bytes(header + bytes(512))
    with pytest.raises(ConfigurationError, match="save with the option -v7"):
        read_structure(tmp_path / "link.mat")


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("symmetry", ["general", "symmetric"])
def test_matrix_market_of_another_writer_is_read_alike(tmp_path: Path, sparse: bool, symmetry: str) -> None:
    matrix = BEAM.structure(2, sparse).stiffness
    scipy.io.mmwrite(tmp_path / "any.mtx", matrix, comment="of a test", precision=17, symmetry=symmetry)
    np.testing.assert_array_equal(_dense(read_matrix_market(tmp_path / "any.mtx")), _dense(matrix))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 0 1\n",
            "a 'coordinate complex general' matrix",
        ),
        ("%%MatrixMarket matrix array real general\n% nothing\n", "size is missing"),
        ("%%MatrixMarket matrix array real general\n2 2 1\n", "'2 2 1' is no size of a matrix 'array'"),
        ("%%MatrixMarket matrix array real general\n2 2\n1 2 3\n", "3 numbers where its size announces 4"),
        (
            "%%MatrixMarket matrix array real symmetric\n2 3\n1 2 3\n",
            "symmetric matrix of 2 rows and 3 columns",
        ),
        ("%%MatrixMarket matrix coordinate real general\n2 2 1\n3 1 1.0\n", "an index outside 2 x 2"),
        ("%%MatrixMarket matrix coordinate real general\n2 2 1\n1 1 one\n", "could not convert"),
    ],
)
def test_matrix_market_that_is_none_is_told(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "any.mtx").write_text(text)
    with pytest.raises(ValueError, match=told):
        read_matrix_market(tmp_path / "any.mtx")
