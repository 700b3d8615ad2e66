"""The contract kit passes stages that keep the contract and names the clause that another one breaks."""

import warnings
from typing import Any, ClassVar

import numpy as np
import pytest
from pydantic import ConfigDict, NonNegativeInt, model_validator

from robid_core import (
    CandidateDesign,
    Configurations,
    Context,
    Estimator,
    Excitation,
    ExcitationDesign,
    Fit,
    Frf,
    FrfEstimator,
    Record,
    Robot,
)
from robid_core.testing import (
    ContractBroken,
    MassSpringPlant,
    check_covers_truth,
    check_hands_on_what_no_residual_shows,
    check_recovers_plant,
    check_settings,
    check_stage,
    example_artifacts,
    example_context,
    example_fit,
    example_record,
    example_robot,
    plant_record,
)


class Mean(FrfEstimator):
    """Mean over blocks of Y U^-1, with the variance of that mean."""

    discard: NonNegativeInt = 1
    """Periods dropped."""
    covariance_factor: ClassVar[float] = 1.0

    def estimate(self, record: Record) -> Any:
        u, y = record.spectra(discard=self.discard)
        return y @ np.linalg.inv(u)

    def run(self, record: Record) -> Frf:
        blocks = self.estimate(record)
        n_config, n_block, n_freq, n_axis, _ = blocks.shape
        u, _ = record.spectra(discard=self.discard)
        residual = blocks - blocks.mean(axis=1, keepdims=True)
        # Unitary inputs: every column of G has the same noise; pool columns, outputs apart.
        noise = np.einsum("cbfij,cbfkj->cfik", residual, residual.conj()) / ((n_block - 1) * n_axis)
        gram = np.linalg.inv(np.einsum("cbfij,cbfkj->cfik", u, u.conj()))
        scale = np.abs(u[0, 0, 0, 0, 0]) ** 2 * n_axis
        return Frf(
            axis_names=record.axis_names,
            estimator="mean",
            pooling="none",
            sample_time_s=record.run.sample_time_s,
            torque_hold=record.torque_hold,
            angle=record.angle,
            frequency_hz=record.frequency_hz,
            response=blocks.mean(axis=1),
            input_gram_inverse=gram,
            output_covariance=self.covariance_factor * scale * noise,
            degrees_of_freedom=np.full((n_config, n_freq), float((n_block - 1) * n_axis)),
            damping_deviation=record.damping_deviation,
        )


def test_a_good_estimator_passes_without_a_warning() -> None:
    check_stage(Mean, discard=0)


def test_the_plant_of_the_kit_is_what_its_record_shows() -> None:
    """Newton's law by finite differences: M a + D v + K x = B torque in the samples of the record."""
    plant = MassSpringPlant.of(2)
    run = plant_record(plant).run
    position, torque = (run.values(name)[0, 0, 0, 0] for name in ("motor_position", "motor_torque"))
    omega = 2 * np.pi * np.fft.rfftfreq(len(position), run.sample_time_s)[:, None]
    spectrum = np.fft.rfft(position, axis=0)
    speed, acceleration = (
        np.fft.irfft(f * spectrum, len(position), axis=0) for f in (1j * omega, -(omega**2))
    )
    force = acceleration @ plant.mass.T + speed @ plant.damping.T + position @ plant.stiffness.T
    np.testing.assert_allclose(force, torque @ plant.input.T, atol=1e-9 * np.abs(torque).max())


class Joint(Mean):
    """The mean of the means of several records of the same configurations."""

    def run(self, records: tuple[Record, ...]) -> Frf:  # type: ignore[override]
        first, *others = (super(Joint, self).run(record) for record in records)
        total = sum((frf.response for frf in others), first.response)
        return first.replace(response=total / len(records))


def test_a_stage_that_takes_many_artifacts_is_given_some() -> None:
    check_stage(Joint, discard=0)


class Transposed(Mean):
    """Input over output."""

    def estimate(self, record: Record) -> Any:
        return np.swapaxes(super().estimate(record), -1, -2)


class Position(Mean):
    """Position instead of acceleration."""

    def estimate(self, record: Record) -> Any:
        return super().estimate(record) / -((2 * np.pi * record.frequency_hz[:, None, None]) ** 2)


class Overconfident(Mean):
    """Claims a ninth of the variance."""

    covariance_factor = 1 / 9


class Timid(Mean):
    """Claims nine times the variance."""

    covariance_factor = 9.0


@pytest.mark.parametrize("cls", [Transposed, Position])
def test_a_wrong_response_is_found(cls: type[Mean]) -> None:
    with pytest.raises(ContractBroken, match="without noise the response of 2 coupled masses is wrong"):
        check_recovers_plant(cls(), 2)


def test_a_covariance_that_is_too_small_is_found() -> None:
    with pytest.raises(ContractBroken, match="the covariance is too small"):
        check_covers_truth(Overconfident())


def test_a_covariance_that_is_too_large_is_found() -> None:
    with pytest.raises(ContractBroken, match="the covariance is too large"):
        check_covers_truth(Timid())


class Careless(Mean):
    """Loses what no residual shows."""

    def run(self, record: Record) -> Frf:
        return super().run(record).replace(damping_deviation=None)


def test_an_uncertainty_that_is_not_handed_on_is_found() -> None:
    with pytest.raises(ContractBroken, match="damping_deviation, which no residual shows, is not handed on"):
        check_hands_on_what_no_residual_shows(Careless())


class Silent(Mean):
    """States no covariance."""

    def run(self, record: Record) -> Frf:
        return super().run(record).replace(input_gram_inverse=None, output_covariance=None)


def test_an_estimator_without_covariance_passes_with_a_note() -> None:
    with pytest.warns(UserWarning, match="Silent states no covariance"):
        check_stage(Silent, for_axes=(1,))


class Candidates(CandidateDesign):
    """In the middle."""

    count: int = 2
    """How many."""

    def run(self, robot: Robot, context: Context) -> Configurations:
        share = context.generator.uniform(0.4, 0.6, (self.count, robot.n_axis))
        low, high = robot.drives.lower, robot.drives.upper
        return Configurations(robot.axis_names, low + share * (high - low))


class GlobalChance(Candidates):
    """Draws from np.random."""

    def run(self, robot: Robot, context: Context) -> Configurations:
        np.random.uniform()  # noqa: NPY002
        return super().run(robot, context)


class OwnChance(Candidates):
    """Draws from a generator that nobody seeded."""

    def run(self, robot: Robot, context: Context) -> Configurations:
        del context
        return super().run(robot, example_context(int(np.random.default_rng().integers(1 << 60))))


class BeyondLimits(Candidates):
    """Forgets the limits."""

    def run(self, robot: Robot, context: Context) -> Configurations:
        found = super().run(robot, context)
        return found.replace(angle=found.angle + 10)


class OtherAxes(Candidates):
    """Renames the axes."""

    def run(self, robot: Robot, context: Context) -> Configurations:
        return super().run(robot, context).replace(axis_names=tuple("xyzuvw"[: robot.n_axis]))


class WrongType(Candidates):
    """Gives an array."""

    def run(self, robot: Robot, context: Context) -> Any:
        return super().run(robot, context).angle


class Closure(Candidates):
    """Maps a function that no other process can find."""

    def run(self, robot: Robot, context: Context) -> Configurations:
        context.map(lambda x: x, [(1,), (2,)])
        return super().run(robot, context)


class Loose(Candidates):
    """Takes anything."""

    model_config = ConfigDict(extra="ignore")


class Mutable(Candidates):
    """Can be changed."""

    model_config = ConfigDict(frozen=False)


class Forgetful(Candidates):
    """Changes a setting whenever it is read."""

    @model_validator(mode="before")
    @classmethod
    def _grow(cls, value: Any) -> Any:
        return {**value, "count": value.get("count", 2) + 1}


class Undocumented(CandidateDesign):
    def run(self, robot: Robot) -> Configurations:
        raise NotImplementedError


@pytest.mark.parametrize(
    ("cls", "clause"),
    [
        (GlobalChance, "draws from np.random"),
        (OwnChance, "gives other bytes the second time"),
        (BeyondLimits, "2 configurations are beyond the joint limits"),
        (OtherAxes, "the result speaks of the axes"),
        (WrongType, "run gives a ndarray, not a Configurations"),
        (Loose, "takes unknown settings"),
        (Mutable, "is mutable"),
        (Forgetful, "settings change on their way through YAML"),
        (Undocumented, "has no docstring"),
    ],
)
def test_a_broken_clause_is_named(cls: type[CandidateDesign], clause: str) -> None:
    with pytest.raises(ContractBroken, match=clause):
        check_stage(cls, for_axes=(1,))


class Plain:
    """Derived from nothing."""


@pytest.mark.parametrize(
    ("given", "told"),
    [(Plain, "Plain is no stage"), (Candidates(), "an object of Candidates is no stage; give a class")],
)
def test_what_is_no_stage_is_told(given: Any, told: str) -> None:
    with pytest.raises(ContractBroken, match=told):
        check_stage(given)


class Misplaced(Estimator):
    """A fit whose model is of a robot of its own."""

    def run(self, robot: Robot) -> Fit:
        fit = example_fit(robot)
        heavier = Robot(robot.with_parameters({"mass.axis_1": 41.0}).description)
        return fit.replace(model=heavier.model(fit.parameters.as_mapping()))


class Unbuilt(Estimator):
    """A fit whose model has an effect that nobody has."""

    def run(self, robot: Robot) -> Fit:
        fit = example_fit(robot)
        assert fit.model is not None
        return fit.replace(model=fit.model.replace(effects='{"found": {"use": "friction.none"}}'))


@pytest.mark.parametrize(
    ("cls", "clause"),
    [
        (Misplaced, "its model is of one_axis, not of the robot that it was given"),
        (Unbuilt, "no robot can be made of its model: no effect 'friction.none'"),
    ],
)
def test_a_model_that_is_not_the_robots_is_found(cls: type[Estimator], clause: str) -> None:
    with pytest.raises(ContractBroken, match=clause):
        check_stage(cls, for_axes=(1,))


def test_a_task_that_cannot_travel_is_found() -> None:
    with pytest.raises((AttributeError, TypeError), match="(?i)pickle|local object"):
        check_stage(Closure, for_axes=(1,))


def test_a_good_candidate_design_passes() -> None:
    check_stage(Candidates, count=3)


class Meddler(ExcitationDesign):
    """Turns the configurations it was given."""

    def run(self, configurations: Configurations, robot: Robot) -> Excitation:
        artifacts = example_artifacts(robot)
        object.__setattr__(configurations, "angle", configurations.angle + 1e-3)
        excitation = artifacts[Excitation]
        assert isinstance(excitation, Excitation)
        return excitation


class Drifting(ExcitationDesign):
    """A reference that walks away."""

    def run(self, configurations: Configurations, robot: Robot) -> Excitation:
        del configurations
        excitation = example_artifacts(robot)[Excitation]
        assert isinstance(excitation, Excitation)
        return excitation.replace(reference=excitation.reference + 0.1)


@pytest.mark.parametrize(
    ("cls", "clause"),
    [
        (Meddler, "run changes what it is given: configurations"),
        (Drifting, "does not come back to where it began"),
    ],
)
def test_a_broken_excitation_is_named(cls: type[ExcitationDesign], clause: str) -> None:
    with pytest.raises(ContractBroken, match=clause):
        check_stage(cls, for_axes=(1,))


def test_wrong_settings_are_told_by_the_stage_itself() -> None:
    with pytest.raises(ValueError, match="greater than or equal to 0"):
        check_settings(Mean, discard=-1)


@pytest.mark.parametrize("n_axis", [1, 2, 3])
def test_examples_fit_together(n_axis: int) -> None:
    robot = example_robot(n_axis)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        artifacts = example_artifacts(robot)
    assert robot.n_axis == n_axis
    for artifact in artifacts.values():
        assert getattr(artifact, "axis_names", robot.axis_names) == robot.axis_names


def test_the_example_record_is_steady() -> None:
    """Settled to a tenth of the slow sine's travel between one period and the next, beside a drift of the mean."""
    record = example_record(example_robot(1))
    position = record.run.values("motor_position")
    moved = position - position.mean(axis=4, keepdims=True)
    change = np.abs(moved[:, :, :, -1] - moved[:, :, :, 0]).max()
    assert change < 0.1 * np.abs(moved).max()
