"""Artifacts in, artifacts out: by key, by content, across versions of the format."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from robid_core import Configurations, Fit, ParameterTable, Report
from robid_core.errors import ConfigurationError, StoreError
from robid_core.store import State, Store, canonical_json
from robid_core.store.entry import STORE_FORMAT
from robid_core.store.files import CHUNK
from robid_core.store.store import size_of

GOLDEN = Path(__file__).parent / "golden"
KEY, OTHER = "01" * 32, "02" * 32


@pytest.fixture
def store(tmp_path: Path) -> Store:
    store = Store(tmp_path)
    store.prepare()
    return store


def test_what_is_put_is_found_and_read(store: Store, artifact: Configurations) -> None:
    assert store.lookup(KEY).state is State.ABSENT
    entry = store.put(KEY, "where", artifact, {"settings": {"count": 3}}, recording=False)
    found = store.lookup(KEY)
    assert found.state is State.PRESENT
    assert found.entry == entry
    assert (store.read(entry, Configurations).angle == artifact.angle).all()


def test_bytes_that_are_gone_or_changed_are_no_artifact(store: Store) -> None:
    large = Configurations(("axis_1",), np.arange(200_000.0)[:, None])
    entry = store.put(KEY, "where", large, {}, recording=False)
    blob = store.blobs / entry.blob_name
    assert blob.stat().st_size > CHUNK
    whole = blob.read_bytes()
    assert entry.sha256 == hashlib.sha256(whole).hexdigest()
    blob.chmod(0o644)
    blob.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))  # beyond the first block
    assert store.lookup(KEY).state is State.DAMAGED
    with pytest.raises(StoreError, match=r"where: .* is damaged: its sha256 is .*run again"):
        store.read(entry, Configurations)
    blob.unlink()
    assert store.lookup(KEY).state is State.DAMAGED
    with pytest.raises(StoreError, match="is missing; run again"):
        store.read(entry, Configurations)


def test_equal_content_is_stored_once(store: Store, artifact: Configurations) -> None:
    first = store.put(KEY, "a", artifact, {}, False)
    second = store.put(OTHER, "b", Configurations(artifact.axis_names, artifact.angle.copy()), {}, False)
    assert first.sha256 == second.sha256
    assert len(list(store.blobs.iterdir())) == 1


def test_public_names_cost_no_space_and_are_read_only(store: Store, artifact: Configurations) -> None:
    entry = store.put(KEY, "where", artifact, {}, False)
    path = store.publish("where", entry)
    assert path == store.artifacts / "where.h5"
    assert path.samefile(store.blobs / entry.blob_name)
    assert path.stat().st_mode & 0o777 == 0o444


def test_a_page_keeps_its_suffix(store: Store) -> None:
    entry = store.put(KEY, "page", Report("<p>è</p>"), {}, False)
    assert store.publish("page", entry).read_text(encoding="utf-8") == "<p>è</p>"
    assert store.read(entry, Report).html == "<p>è</p>"


@pytest.mark.parametrize("name", ["../out", "a/b", "", ".hidden", "a\0b", "a\nb"])
def test_a_name_that_is_a_path_is_refused(store: Store, artifact: Configurations, name: str) -> None:
    with pytest.raises(ConfigurationError):
        store.put(KEY, name, artifact, {}, False)


@pytest.mark.parametrize("folder", sorted(GOLDEN.iterdir()), ids=lambda path: path.name)
def test_stores_of_earlier_formats_are_read(folder: Path) -> None:
    found = Store(folder).lookup("5a" * 32)
    assert found.state is State.PRESENT
    assert found.entry is not None
    angle = Store(folder).read(found.entry, Configurations).angle
    assert angle.tolist() == [[0.5, -0.25], [1.0, 2.0]]


def test_there_is_a_golden_store_of_every_format() -> None:
    assert {path.name for path in GOLDEN.iterdir()} == {f"format_{n}" for n in range(1, STORE_FORMAT + 1)}


def test_an_artifact_reads_like_the_one_in_the_golden_store(store: Store) -> None:
    artifact = Configurations(("axis_1", "axis_2"), np.array([[0.5, -0.25], [1.0, 2.0]]))
    entry = store.put(KEY, "where", artifact, {}, False)
    # Content, not bytes: another release of HDF5 may lay a file out otherwise.
    golden = next((GOLDEN / f"format_{STORE_FORMAT}" / "store" / "blobs").iterdir())
    assert (Configurations.read(golden).angle == store.read(entry, Configurations).angle).all()


def test_a_store_of_a_newer_robid_is_refused_and_left_alone(tmp_path: Path) -> None:
    shutil.copytree(GOLDEN / "format_1", tmp_path / "run")
    path = tmp_path / "run" / "store" / "index" / f"{'5a' * 32}.json"
    content = json.loads(path.read_text())
    content.pop("check")
    content["format"] = STORE_FORMAT + 1
    content["check"] = hashlib.sha256(canonical_json(content).encode()).hexdigest()
    path.write_text(json.dumps(content))
    before = path.read_bytes()
    with pytest.raises(StoreError, match="written by a newer robid"):
        Store(tmp_path / "run").lookup("5a" * 32)
    assert path.read_bytes() == before


def test_drafts_that_a_killed_run_left_are_cleared(store: Store, artifact: Configurations) -> None:
    (store.temporary / "123-0.h5").write_bytes(b"half")
    store.prepare()
    assert list(store.temporary.iterdir()) == []


def test_a_draft_that_cannot_be_cleared_is_named(store: Store) -> None:
    (store.temporary / "mine").mkdir()
    with pytest.raises(
        StoreError, match=f"cannot clear away {store.temporary / 'mine'}: Is a directory; .*move it"
    ):
        store.prepare()


def test_the_size_told_when_a_disk_is_full_is_about_right(tmp_path: Path) -> None:
    big = Configurations(("a",) * 6, np.zeros((20000, 6)))
    big.write(tmp_path / "a.h5")
    assert abs(size_of(big) / (tmp_path / "a.h5").stat().st_size - 1) < 0.05
    one = np.ones(1)
    flag = np.array([True])
    table = ParameterTable(("k",), ("N m/rad",), ("stiffness",), one, one, one, flag, flag)
    nested = Fit("m", "s", True, 1.0, 1, 1, table, np.zeros((200, 200)))
    assert size_of(nested) > 200 * 200 * 8


def test_canonical_text_does_not_depend_on_order_and_refuses_nan() -> None:
    assert canonical_json({"b": 1.0, "a": [True, None]}) == canonical_json({"a": (True, None), "b": 1.0})
    assert canonical_json({"a": 1}) != canonical_json({"a": 1.0})
    with pytest.raises(ValueError, match="not JSON compliant"):
        canonical_json(float("nan"))
