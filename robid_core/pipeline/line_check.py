"""Records without excited lines at stages that cannot do without: told from the wiring, before anything is measured."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from robid_core.artifacts import Excitation, Record
from robid_core.pipeline.resolving import Declared
from robid_core.pipeline.wiring import Wires, each
from robid_core.stage import Acquisition, ExcitationDesign, Stage
from robid_core.yaml_file.problems import ProblemList


def check_lines(declared: Mapping[str, Declared], wires: Wires, problems: ProblemList) -> None:
    """Tell which stages take a record whose excitation has no lines, where they need them.

    Parameters
    ----------
    declared
        The stages by name.
    wires
        What feeds each of them, by parameter.
    problems
        Takes the mistakes.
    """
    for name, stage in declared.items():
        if stage.stage is None or not stage.stage.needs_lines:
            continue
        lacking = [
            (declared[source], advice)
            for source in sources_behind(name, declared, wires)
            if (advice := _advice(declared[source].stage))
        ]
        if lacking:
            first, advice = lacking[0]
            problems.add(
                stage.node.keys["use"],
                ("stages", name, "use"),
                f"{stage.plugin} reads the lines of a periodic record, and {first.plugin} of stage '{first.name}' has "
                f"none; {advice}, or frf.spectral",
            )


def _advice(made: Stage | None) -> str:
    """What to do about an excitation or recordings without lines; empty where they have some."""
    if isinstance(made, ExcitationDesign) and not made.excites_lines:
        return "take a periodic excitation such as excitation.multisine"
    if isinstance(made, Acquisition) and not made.gives_lines:
        return "give it period_s and lines (auto finds either), where the motion repeats"
    return ""


def sources_behind(name: str, declared: Mapping[str, Declared], wires: Wires) -> Sequence[str]:
    """Return the stages whose excitation or recordings are in the records that a stage takes, each once."""

    def walk(consumer: str) -> Iterator[str]:
        for source in (one for named in wires.get(consumer, {}).values() for one in each(named)):
            output = declared[source].output
            if output is not None and issubclass(output, Excitation):
                yield source
            elif output is not None and issubclass(output, Record):
                yield source
                yield from walk(source)

    return list(dict.fromkeys(walk(name)))
