"""Units of work travel by name, and are computed only by the code they were asked for with."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest

from robid_core.errors import ConfigurationError, PluginError
from robid_core.executors import task as task_module
from robid_core.executors.task import perform, sources_digest, unit
from robid_core.registry import EFFECTS, TASKS, Registry, registry


@pytest.fixture
def stranger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Install a stranger's unit of work and return its source."""
    source = tmp_path / "strange_work.py"
    source.write_text("def double(number):\n    return 2 * number\n")
    info = tmp_path / "strange_work-1.5.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: strange_work\nVersion: 1.5\n")
    (info / "entry_points.txt").write_text(f"[{TASKS}]\nstrange.double = strange_work:double\n")
    monkeypatch.syspath_prepend(tmp_path)
    points = [p for d in metadata.distributions(path=[str(tmp_path)]) for p in d.entry_points]
    found = Registry([*points, *metadata.entry_points(group=EFFECTS)])
    monkeypatch.setattr(task_module, "registry", lambda: found)
    sources_digest.cache_clear()
    yield source
    sys.modules.pop("strange_work", None)
    sources_digest.cache_clear()


def test_a_unit_is_called_by_its_name(stranger: Path) -> None:
    codes = unit(TASKS, "strange.double", [(EFFECTS, "friction.lugre"), (EFFECTS, "friction.lugre")])
    assert [code[:3] for code in codes] == [
        (TASKS, "strange.double", "strange_work"),
        (EFFECTS, "friction.lugre", "robid"),
    ]
    assert perform(codes, (21,)) == 42


def test_another_version_or_other_sources_refuse(stranger: Path) -> None:
    (code,) = unit(TASKS, "strange.double")
    group, name, distribution, version, digest = code
    with pytest.raises(
        PluginError, match=r"with strange_work 1\.6 .* it has strange_work 1\.5 .* install the same"
    ):
        perform(((group, name, distribution, "1.6", digest),), (1,))
    with pytest.raises(
        PluginError, match=r"strange_work 1\.5 \(sources 0123\); it has other sources \(sources"
    ):
        perform(((group, name, distribution, version, "0123"),), (1,))


def test_what_is_not_installed_refuses(stranger: Path) -> None:
    (code,) = unit(TASKS, "strange.double")
    absent = (EFFECTS, "friction.unheard", "robid-unheard", "3.0", "")
    with pytest.raises(
        PluginError, match=r"'friction\.unheard' is not installed on .*; install robid-unheard 3\.0"
    ):
        perform((code, absent), (1,))
    with pytest.raises(
        ConfigurationError, match=r"no task 'strange\.triple'; did you mean 'strange\.double'"
    ):
        unit(TASKS, "strange.triple")


def test_sources_are_known_by_content(stranger: Path) -> None:
    before = sources_digest("strange_work")
    os.utime(stranger, (1, 1))
    sources_digest.cache_clear()
    assert sources_digest("strange_work") == before
    stranger.write_text("def double(number):\n    return number + number\n")
    sources_digest.cache_clear()
    assert sources_digest("strange_work") != before
    assert sources_digest("no_such_package_anywhere") == ""


def test_the_simulation_of_experiments_is_registered() -> None:
    from robid_core.robot.batch import UNIT
    from robid_core.robot.experiments import simulate_experiments

    assert registry().load(TASKS, UNIT) is simulate_experiments
