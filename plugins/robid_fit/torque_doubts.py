"""What only a torque fit can doubt: channels far apart, bodies unlike the file's, axes that rattle or stand still."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid_core import BoolArray, Doubt, FloatArray, Record
from robid_core.estimation.standstill import rests_of
from robid_core.residual import Solution, TorqueProblem, WindowedBlock, times_faster
from robid_fit.tolerances import WIDENED, tolerance_factor

LATEST = 2.0  # samples between the channels of angle and torque: drives differ by less
PROMISED = 0.01  # tolerance of bodies that nobody states
HALF, HOLD = 0.5, 0.1  # samples that another hold makes, and by which a delay may miss them
CERTAIN = 3.5  # standard errors
STANDING = 0.2  # of the samples


def doubts(problem: TorqueProblem, solution: Solution) -> tuple[Doubt, ...]:
    """Return the reasons not to rely on a fit that lie in where it ended."""
    timing = (*_late(problem, solution.point), *_of_samples(problem, solution))
    return (*timing, *_unlike(problem, solution), *rattling(problem))


def with_rests(
    found: tuple[Doubt, ...], records: Sequence[Record], problem: TorqueProblem
) -> tuple[Doubt, ...]:
    """Put the doubt about axes that stand still first, and leave out what a fit says of clocks: a consequence.

    Axes of which a problem does not count such samples are no reason to doubt.
    """
    rests = standing(records, _left_out_at_rest(problem))
    clear = (one for one in found if not (rests and one.kind == "timing"))
    return (*rests, *clear, *_left_out(problem))


def standing(records: Sequence[Record], but: BoolArray) -> tuple[Doubt, ...]:
    """Doubt friction of axes that stand still for much of the time: what holds them is no function of the speed.

    `but`: of some, (n_axis,).
    """
    shares = np.where(but, 0.0, _share_at_rest(records))
    told = [
        f"{name} in {100 * share:.0f} %"
        for name, share in zip(records[0].axis_names, shares.tolist(), strict=True)
        if share > STANDING
    ]
    if not told:
        return ()
    return (
        Doubt(
            "standstill",
            f"axes stand still for much of the time: {', '.join(told)} of the samples. Friction holds an axis at rest "
            "by any torque up to its level, which no function of the speed says",
            "leave such samples out (at_rest: leave_out, of motions that do not repeat), cut the record to where the "
            "axes move (start_s, stop_s), or measure motions without rests",
        ),
    )


def _left_out(problem: TorqueProblem) -> tuple[Doubt, ...]:
    """Say which share of the samples does not count since friction holds an axis."""
    told = [
        f"{name} {100 * share:.0f} %"
        for name, share in zip(problem.free.robot.axis_names, problem.at_rest.tolist(), strict=True)
        if share > STANDING
    ]
    if not told:
        return ()
    sentence = (
        "samples at which friction holds an axis, at rest or where it turns back more abruptly than its angle "
        f"resolves, do not count in its torque: {', '.join(told)} of the samples"
    )
    return (Doubt("standstill", sentence, "at_rest: keep counts them", "remark"),)


def _left_out_at_rest(problem: TorqueProblem) -> BoolArray:
    """Axes of which rests do not count, (n_axis,): in motions that do not repeat."""
    left_out = np.zeros(problem.free.robot.n_axis, dtype=np.bool_)
    for block in problem.blocks:
        if isinstance(block, WindowedBlock) and block.moving is not None:
            left_out |= (block.moving.weight[..., : len(left_out)] < 1).any(axis=(0, 1, 2))
    return left_out


def unseen_sticks(axis_names: Sequence[str]) -> tuple[Doubt, ...]:
    """Say that only the torque showed that friction holds axes where they turn back."""
    if not axis_names:
        return ()
    sentence = (
        f"where {' and '.join(axis_names)} turn{'s' * (len(axis_names) == 1)} back, torque is no function of the "
        "speed; samples there do not count, which explains most of what was left. Friction that turns more abruptly "
        "than the measured angle resolves holds a motor for a moment, or a law acts there that the robot file lacks"
    )
    remedy = "at_rest: keep counts them; a diagnosis says whether a law explains them"
    return (Doubt("standstill", sentence, remedy, "remark"),)


def _share_at_rest(records: Sequence[Record]) -> FloatArray:
    """Share of the samples at which each axis stands still, (n_axis,)."""
    angles, times = list[FloatArray](), list[float]()
    for run in (run for record in records for run in record.runs if "motor_position" in run.channels):
        for angle in run.lanes("motor_position"):
            angles.append(angle[np.isfinite(angle).all(axis=1)])
            times.append(run.sample_time_s)
    if not angles:
        return np.zeros(len(records[0].axis_names))
    still = np.concatenate(rests_of(angles, times))
    result: FloatArray = still.mean(axis=0)
    return result


def rattling(problem: TorqueProblem) -> tuple[Doubt, ...]:
    """Say which experiments a fit left out: it stands on the others."""
    n_left_out, n = sum(problem.left_out), sum(np.prod(block.measured.shape[:2]) for block in problem.blocks)
    if not n_left_out:
        return ()
    sentence = (
        f"{n_left_out} of {n} experiments {'is' if n_left_out == 1 else 'are'} not used: the model rattles there "
        "within a gap and does not repeat its motion as the machine did"
    )
    remedy = "measure smaller or slower motions, or poses in which gravity loads the axis"
    return (Doubt("rattling", sentence, remedy, "remark"),)


def _late(problem: TorqueProblem, point: FloatArray) -> tuple[Doubt, ...]:
    """Doubt channels that are further apart than those of one drive are."""
    delay, sample_time = problem.delay(point), problem.blocks[0].motion.sample_time_s
    axes = problem.free.robot.axis_names
    lags = {"the torque": float(delay[np.argmax(np.abs(delay))])}
    lags |= {
        f"{one.channel} of {axes[one.axis]}": float(late)
        for one, late in zip(problem.sensors, problem.sensing(point)[1], strict=True)
    }
    found = []
    for channel, lag in lags.items():
        samples = lag / sample_time
        if abs(samples) <= LATEST:
            continue
        way = "lags" if samples > 0 else "leads"
        sentence = (
            f"{channel} {way} the angles by {abs(samples):.1f} samples, or more: the fit looks near zero only"
        )
        remedy = "look at the clocks of both channels, and shift the recorded one until a fit finds less than a sample"
        found.append(Doubt("timing", sentence, remedy))
    return tuple(found)


def _of_samples(problem: TorqueProblem, solution: Solution) -> Iterator[Doubt]:
    """Remark on torques that are late or early as with a hold for a sample or a part of one, or by more."""
    motion = problem.blocks[0].motion
    delay = problem.delay(solution.point) / motion.sample_time_s
    error = np.sqrt(np.diag(solution.covariance)[-problem.n_delay :]) / motion.sample_time_s
    times = times_faster(delay, error) if motion.torque_hold == "continuous" else None
    if times is not None and times > 1:
        held = motion.sample_time_s / times
        yield Doubt(
            "timing",
            f"the torque leads the angles by {-float(np.mean(delay)):.2f} samples, as where a controller that is "
            f"{times} times as fast as the recording holds each; the fit counts a delay, and not what a hold takes "
            "at high frequencies",
            f"say it where the record is read (motor_torque: held_s: {held:.4g}) if that is how the drive works",
            "remark",
        )
        return
    if not (np.abs(delay) - CERTAIN * error > HALF - HOLD).all() or np.ptp(delay) > HOLD:
        return
    lag, way = float(np.mean(delay)), "lags" if np.mean(delay) > 0 else "leads"
    sentence = f"the torque {way} the angles by {abs(lag):.2f} samples, which the fit counts"
    other = "continuous" if motion.torque_hold == "zero_order_hold" else "zero_order_hold"
    if abs(abs(lag) - HALF) <= HOLD and (lag > 0) == (other == "continuous"):
        remedy = (
            f"torque_hold: {motion.torque_hold} is stated, and with {other} there would be no delay; state that one if "
            "it is what the drive does"
        )
        yield Doubt("timing", sentence, remedy, "remark")
    elif HALF + HOLD < abs(lag) <= LATEST:
        remedy = f"say it where the record is read (motor_torque: delay_s: {lag * motion.sample_time_s:.2g})"
        yield Doubt("timing", sentence, remedy, "remark")


def _in_tolerances(problem: TorqueProblem, point: FloatArray) -> dict[str, float]:
    """How far each number of a body is from the robot file, in standard deviations of what the priors allow."""
    free, n = problem.free, problem.n_free
    allowed = np.sqrt(((free.jacobian(np.zeros(n)) * problem.prior[:n]) ** 2).sum(axis=1))
    values = free.values(point[:n])
    return {
        name: abs(values[name] - start) / own
        for name, start, own in zip(free.names, free.start.tolist(), allowed.tolist(), strict=True)
        if free.robot.parameter_kind(name) == "inertia" and own > 0
    }


def _tolerance_of(problem: TorqueProblem, group: str) -> float:
    """Smallest tolerance of a group of numbers, `mass`, in natural scales."""
    own = [name.startswith(f"{group}.") for name in problem.free.names]
    return float(problem.prior[: problem.n_free][own].min())


def _unlike(problem: TorqueProblem, solution: Solution) -> tuple[Doubt, ...]:
    """Doubt bodies that deviate from the robot file by more than the tolerances: then their errors are too small."""
    free, n = problem.free, problem.n_free
    bodies = np.array([free.robot.parameter_kind(name) == "inertia" for name in free.names], dtype=bool)
    if not bodies.any():
        return ()
    prior, point = problem.prior[:n][bodies], solution.point[:n][bodies]
    error = np.sqrt(np.diag(solution.covariance)[:n][bodies])
    times = tolerance_factor(point, error, prior, least_seen=1.0)
    if times <= WIDENED:
        return ()
    far = {name: own for name, own in _in_tolerances(problem, solution.point).items() if own > WIDENED}
    worst = max(far, key=lambda name: far[name], default="")
    groups = dict.fromkeys(name.partition(".")[0] for name in far)
    stated = {one: _tolerance_of(problem, one) for one in groups}
    at_default = [one for one, own in stated.items() if own <= 1.5 * PROMISED]
    wider = ", ".join(f'"{one}.*": 0.1' for one in at_default)
    known = min(stated.values(), default=1.0)
    remedy = (
        f"state how well they are known (prior: {{{wider}}}; {PROMISED:g} unless set), or look for what the model "
        "lacks (robid diagnose)"
        if at_default
        else f"look for what the model lacks (robid diagnose); a tolerance of {known:.2g} was stated for it already"
    )
    sentence = f"bodies differ from the robot file by {times:.3g} times their stated tolerances"
    sentence += f", {worst} by {far[worst]:.3g} times its own" if worst else ""
    return (Doubt("tolerance", sentence, remedy),)
