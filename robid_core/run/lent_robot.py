"""The robot that a stage is lent: the nominal one, or by `inputs: {robot: fit}` the one that a stage found."""

from __future__ import annotations

from robid_core.artifacts import Artifact, Fit
from robid_core.errors import ConfigurationError, NotTrustworthy, PluginError
from robid_core.pipeline import Pipeline, StageNode
from robid_core.registry import EFFECTS, Plugin, registry
from robid_core.robot import Robot


def robot_source(node: StageNode) -> str | None:
    """Return the stage whose robot this one takes; None where it takes the nominal one."""
    for name, kind in node.stage.lends().items():
        source = node.inputs.get(name)
        if kind is Robot and isinstance(source, str):
            return source
    return None


def robot_from(artifact: Artifact, source: str, dynamics: str) -> Robot:
    """Return the robot that the artifact of stage `source` holds.

    Raises
    ------
    NotTrustworthy
        Where it is of a fit that did not converge.
    ConfigurationError
        Where it holds no model.
    """
    if isinstance(artifact, Fit) and not artifact.converged:
        raise NotTrustworthy(f"its robot is that of '{source}', which must not be used: {artifact.status}")
    model = getattr(artifact, "model", None)
    if model is None:
        raise ConfigurationError(
            f"its robot is to be that of '{source}', whose {type(artifact).__name__} holds no model; take a stage that "
            "gives one, as fit.torque_residual does, or leave `robot` out of `inputs`"
        )
    return Robot.of_model(model, dynamics)


def effect_plugins(robot: Robot) -> list[Plugin]:
    """Return the plugins of the effects that act in a robot."""
    names = {effect.use for effect in robot.description.effects.values()}
    return [registry().find(EFFECTS, name) for name in sorted(names)]


def possible_effects(node: StageNode, pipeline: Pipeline, nominal: Robot) -> list[Plugin]:
    """Return the plugins of the effects that may act in the robot of a stage, known before anything runs.

    Those of the nominal robot and, where it takes the robot of another stage, those that this one or what stands before
    it names in `uses()`.
    """
    found = {plugin.name: plugin for plugin in effect_plugins(nominal)}
    source = robot_source(node)
    waiting, seen = [source] if source is not None else [], set[str]()
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        maker = pipeline.stage(name)
        uses = getattr(maker.stage, "uses", None)
        for group, use in uses() if callable(uses) else ():
            if group == EFFECTS:
                plugin = registry().find(group, use)
                found[plugin.name] = plugin
        waiting += maker.feeds
    return [found[name] for name in sorted(found)]


def refuse_unnamed_effects(robot: Robot, source: str, possible: list[Plugin]) -> None:
    """Raise PluginError where a robot has an effect whose code is in no key: results would outlive its changes."""
    unnamed = [plugin.name for plugin in effect_plugins(robot) if plugin not in possible]
    if unnamed:
        raise PluginError(
            f"the robot of '{source}' has {', '.join(unnamed)}, which no stage names; let the stage that adds an "
            'effect say so: def uses(self): return [("robid.effects", ...)]'
        )
