"""Only what depends on a change is made again, and nothing that only looks like a change counts."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults.fault import fault

from robid_core.errors import DataRejected
from robid_core.pipeline import Pipeline
from robid_core.run import sources
from robid_core.run.identity import Surroundings, ingredients_of

ORDER = ["where", "acquire", "frf", "fit", "choose", "page"]


def test_a_changed_setting_reruns_only_what_depends_on_it(world: Any) -> None:
    world.run()
    world.ran()
    result = world.run("stages.choose.with.experiments=5")
    assert world.ran() == ["choose", "page"]
    assert [name for name, outcome in result.outcomes.items() if outcome == "kept"] == ORDER[:4]


def test_an_artifact_made_again_with_the_same_bytes_reruns_nothing_behind_it(world: Any) -> None:
    world.run()
    world.ran()
    result = world.run("stages.fit.with.hold=0.001")  # another setting, the same fit
    assert world.ran() == ["fit"]
    assert result.outcomes["fit"] == "same"
    assert result.outcomes["page"] == "kept"


def test_an_old_setting_finds_its_old_result(world: Any) -> None:
    world.run()
    before = world.hashes()
    world.run("stages.fit.with.hold=0.001", "stages.page.with.title=other")
    assert world.hashes() != before
    world.ran()
    world.run()
    assert world.ran() == []
    assert world.hashes() == before


def test_the_seed_reaches_every_stage_that_draws(world: Any) -> None:
    world.run()
    world.ran()
    world.run("seed=8")
    assert world.ran() == ORDER


def test_a_stage_that_draws_nothing_does_not_depend_on_the_seed(world: Any) -> None:
    world.run("stages.fit.with.outcome=not converged")
    found = world.run("stages.fit.with.outcome=not converged").manifest
    assert "seed" in found.stages["where"].ingredients
    assert "seed" not in found.stages["page"].ingredients


def test_another_stage_more_changes_no_other_stages_chance(world: Any) -> None:
    world.run()
    world.ran()
    world.say("stages:\n", "stages:\n  early: {use: strange.where}\n")
    world.run()
    assert world.ran() == ["where"]  # the new one's code; the old one keeps its seed and its result


def test_comments_order_and_times_of_files_change_nothing(world: Any) -> None:
    world.run()
    world.ran()
    text = world.file.read_text()
    head, _, stages = text.partition("stages:\n")
    lines = stages.splitlines(keepends=True)
    world.file.write_text("# a comment\n" + head + "stages:\n" + "".join(reversed(lines)))
    for path in (world.file, world.source, *world.folder.rglob("*.h5")):
        os.utime(path, (1, 1))
    sources.forget()
    world.run()
    assert world.ran() == []


def test_a_data_file_counts_by_its_content(
    world: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    data = tmp_path / "data"
    data.mkdir()
    monkeypatch.setenv("ROBID_DATA", str(data))
    np.savetxt(data / "angles.txt", [[0.1], [0.2]])
    world.say("{use: strange.where}", "{use: strange.file, with: {path: angles.txt}}")
    world.run()
    world.ran()
    os.utime(data / "angles.txt", (1, 1))
    world.run()
    assert world.ran() == []
    np.savetxt(data / "angles.txt", [[0.1], [0.3]])
    world.run()
    assert world.ran() == ORDER


def test_another_robot_reruns_what_is_lent_the_robot(world: Any) -> None:
    world.run()
    world.ran()
    world.run("robot=one_axis_true")
    # Configurations come out as before (they use the number of axes only), so that what follows them is kept;
    # the fit and the page are lent the robot (the page by way of the truth).
    assert world.ran() == ["where", "fit", "page"]


def test_drives_count_for_what_moves_and_for_what_sees_the_truth(world: Any) -> None:
    world.run()
    world.ran()
    result = world.run("drives.with.stiffness=3.0")
    assert world.ran() == ["acquire", "page"]
    assert result.outcomes["acquire"] == "same"
    assert " 3.0 " in (world.folder / "artifacts" / "page.html").read_text()


@pytest.mark.parametrize("editable", [True, pytest.param(False, marks=pytest.mark.full)])
def test_an_edited_plugin_is_never_served_from_the_store(world: Any, editable: bool) -> None:
    world.install(editable)  # not editable: found beside the project, by its path alone
    assert world.elsewhere().returncode == 0
    before = world.hashes()
    world.ran()
    world.edit("BIAS = 0.0", "BIAS = 1.0")
    assert world.elsewhere().returncode == 0
    assert world.ran() == ORDER
    assert world.hashes()["where.h5"] == before["where.h5"]
    assert world.hashes()["frf.h5"] != before["frf.h5"]


def test_a_local_package_that_a_plugin_imports_counts_like_the_plugin(world: Any) -> None:
    helper = world.site / "strange_physics.py"
    helper.write_text("G = 9.81\n")
    world.edit("BIAS = 0.0", "import strange_physics\n\nBIAS = 0.0")
    first = sources.sources_hash("robid_strange_stages", "robid_strange_stages")
    assert "strange_physics" in sources.local_packages("robid_strange_stages")
    helper.write_text("G = 1.62\n")
    sources.forget()
    assert sources.sources_hash("robid_strange_stages", "robid_strange_stages") != first


def test_plugins_that_a_stage_says_it_uses_count_like_its_own(
    world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robid_core.run.identity.registry", world.registry)
    world.edit(
        '    path: DataPath\n    """The file."""\n',
        """    path: DataPath

    def uses(self) -> list[tuple[str, str]]:
        return [("robid.tasks", "strange")]

""",
    )
    world.say("{use: strange.where}", "{use: strange.file, with: {path: pipeline.yaml}}")
    pipeline = Pipeline.load(world.file, data_root=world.project, plugins=world.registry())
    found = ingredients_of(pipeline.stage("where"), {}, Surroundings(pipeline, pipeline.robot.load()))
    assert found["plugins"]["strange"]["version"] == "1.0"
    assert found["plugins"]["strange"]["sources"] == found["stage"]["sources"]


def test_packages_of_an_index_are_known_by_their_version(world: Any) -> None:
    assert sources.sources_hash("numpy.linalg", "numpy") is None


def test_another_version_of_a_plugin_reruns_its_stages(world: Any) -> None:
    world.run()
    world.ran()
    world.install(editable=True, version="1.1")
    result = world.run()
    assert world.ran() == ORDER
    assert set(result.outcomes.values()) == {"same"}


def test_another_version_of_robid_reruns_everything(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    world.run()
    world.ran()
    monkeypatch.setattr("robid_core.run.identity.__version__", "9.9.9")
    world.run()
    assert world.ran() == ORDER


@fault(
    "A13",
    sees="exit 5: the file that changed while a stage ran; what was made of it is not kept as the result of another",
    mutant=("robid_core/run/runner.py", "        self._refuse_changed_files(node, decision)\n", ""),
)
def test_A13_a_file_that_changes_under_a_stage_gives_no_result(
    world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBID_DATA", str(world.project))
    data = world.project / "angles.txt"
    data.write_text("0.1\n0.2\n")
    world.say("{use: strange.where}", "{use: strange.file, with: {path: angles.txt}}")
    reads = "        values = np.loadtxt("
    world.edit(reads, f"        (context.data_root / self.path).write_text('9')\n{reads}")
    with pytest.raises(
        DataRejected, match=r"A13: changed while the stage ran: .*angles\.txt; nothing was stored"
    ):
        world.run(last="where")
    assert not (world.folder / "artifacts" / "where.h5").exists()
