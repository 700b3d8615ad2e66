"""A project in a temporary folder with a stranger's stages, installed the way an editable install is."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

from oracles.quick_start import run

from robid_core.pipeline import Pipeline
from robid_core.registry import Registry
from robid_core.run import Listener, RunOptions, RunResult, run_pipeline, sources
from robid_core.store import Files, Store

HERE = Path(__file__).parent
PACKAGE = "robid_strange_stages"
STAGES = {
    "strange.where": "Where",
    "strange.file": "FromFile",
    "strange.measure": "Measure",
    "strange.respond": "Respond",
    "strange.estimate": "Estimate",
    "strange.combine": "Combine",
    "strange.choose": "Choose",
    "strange.page": "Page",
    "strange.identify": "Identify",
    "strange.explain": "Explain",
    "strange.tell": "Tell",
}
DRIVES = {"strange": "Simulated", "strange_hardware": "Hardware"}
TEXT = """\
robid: 1
name: strange
seed: 7
robot: one_axis
drives: {use: strange}
stages:
  where: {use: strange.where}
  acquire: {use: strange.measure, inputs: {configurations: where}}
  frf: {use: strange.respond}
  fit: {use: strange.estimate}
  choose: {use: strange.choose, inputs: {configurations: where}}
  page: {use: strange.page}
"""
ORDER = ["where", "acquire", "frf", "fit", "choose", "page"]
# What the command line does, without the command line.
DRIVER = """
import sys
from pathlib import Path
from robid_core.errors import RobidError
from robid_core.pipeline import Pipeline
from robid_core.run import RunOptions, identity, run_pipeline
identity.core_hash = lambda: "core"  # who edits robid while the tests run is no matter
if __name__ == "__main__":
    options = eval(sys.argv[2])
    try:
        result = run_pipeline(Pipeline.load(sys.argv[1]), RunOptions(**options))
    except RobidError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        sys.exit(130)
    print(" ".join(f"{name}={outcome}" for name, outcome in result.outcomes.items()))
    sys.exit(result.exit_code)
"""


class World:
    """One project and one package."""

    def __init__(self, folder: Path) -> None:
        self.site, self.project, self.calls = folder / "site", folder / "project", folder / "calls.txt"
        self.source = self.site / PACKAGE / "__init__.py"
        self.file = self.project / "pipeline.yaml"
        self.driver = folder / "driver.py"
        self.source.parent.mkdir(parents=True)
        self.project.mkdir()
        self.file.write_text(TEXT, encoding="utf-8")
        self.driver.write_text(DRIVER, encoding="utf-8")
        self.source.write_text((HERE / "strange_stages.py").read_text(encoding="utf-8"), encoding="utf-8")
        self.install(editable=True)

    def install(self, editable: bool, version: str = "1.0") -> None:
        """Write the metadata that pip writes."""
        info = self.site / f"{PACKAGE}-1.0.dist-info"
        info.mkdir(exist_ok=True)
        (info / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {PACKAGE}\nVersion: {version}\n", encoding="utf-8"
        )
        lines = ["[robid.stages]", *(f"{name} = {PACKAGE}:{cls}" for name, cls in STAGES.items())]
        lines += ["[robid.drives]", *(f"{name} = {PACKAGE}:{cls}" for name, cls in DRIVES.items())]
        lines += ["[robid.tasks]", f"strange = {PACKAGE}:square"]
        (info / "entry_points.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
        url = info / "direct_url.json"
        url.unlink(missing_ok=True)
        if editable:
            url.write_text(
                json.dumps({"url": self.site.as_uri(), "dir_info": {"editable": True}}), encoding="utf-8"
            )
        sources.forget()

    def registry(self) -> Registry:
        """Return this world's plugins, and the effects that are installed."""
        distributions = metadata.distributions(path=[str(self.site)])
        own = [point for distribution in distributions for point in distribution.entry_points]
        return Registry([*own, *metadata.entry_points(group="robid.effects")])

    def pipeline(self, *overrides: str) -> Pipeline:
        """Read the pipeline file, with this world's plugins."""
        return Pipeline.load(self.file, overrides, plugins=self.registry())

    def run(
        self, *overrides: str, listener: Listener | None = None, files: Files | None = None, **options: Any
    ) -> RunResult:
        """Run in this process."""
        options = {
            "jobs": 1,
            "trust_plugins": True,
            **options,
        }  # quicker, and tests may reach into the stages
        return run_pipeline(self.pipeline(*overrides), RunOptions(**options), listener, files)

    @property
    def environment(self) -> dict[str, str]:
        """Variables for another process."""
        return {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(filter(None, [str(self.site), os.environ.get("PYTHONPATH")])),
            "STRANGE_CALLS": str(self.calls),
            "OMP_NUM_THREADS": "1",
        }

    def command(self, **options: Any) -> list[str]:
        """Return the command line of a run in another process."""
        return [
            sys.executable,
            str(self.driver),
            str(self.file),
            repr({"jobs": 1, "trust_plugins": True, **options}),
        ]

    def elsewhere(self, **options: Any) -> subprocess.CompletedProcess[str]:
        """Run in another process."""
        return run(self.command(**options)[1:], env=self.environment)

    def ran(self) -> list[str]:
        """Return the stages that were called since this was asked last."""
        names = self.calls.read_text(encoding="utf-8").split() if self.calls.exists() else []
        self.calls.unlink(missing_ok=True)
        return names

    def say(self, old: str, new: str) -> None:
        """Change the pipeline file."""
        text = self.file.read_text(encoding="utf-8")
        assert old in text
        self.file.write_text(text.replace(old, new), encoding="utf-8")

    def edit(self, old: str, new: str) -> None:
        """Change the plugin's source."""
        text = self.source.read_text(encoding="utf-8")
        assert old in text
        self.source.write_text(text.replace(old, new), encoding="utf-8")

    @property
    def folder(self) -> Path:
        """The run's folder."""
        return self.project / "runs" / "strange"

    @property
    def store(self) -> Store:
        """The run's store."""
        return Store(self.folder)

    def hashes(self) -> dict[str, str]:
        """Return the sha256 of every artifact that a user would open."""
        return {
            path.name: hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted((self.folder / "artifacts").iterdir())
        }

    @staticmethod
    def flip(path: Path, place: int = -1) -> None:
        """Flip one bit of a file."""
        data = bytearray(path.read_bytes())
        data[place] ^= 1
        path.chmod(0o644)
        path.write_bytes(data)

    def blob(self, stage: str) -> Path:
        """Return the file that holds a stage's bytes."""
        artifact = next(path for path in (self.folder / "artifacts").iterdir() if path.stem == stage)
        return next(path for path in (self.folder / "store" / "blobs").iterdir() if path.samefile(artifact))
