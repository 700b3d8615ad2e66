"""Gears and bearings as their makers' data sheets describe them, turned into springs, dampers and an effect.

Sheets of strain-wave gears give the torsional stiffness in three ranges of torque (K1 up to T1, K2 up to T2, K3 above);
those of cycloidal gears one stiffness, and the lost motion at +-3 % of the rated torque; those of cross-roller and
main bearings the moment rigidity. No sheet gives damping: default ratios stand here, with what they are ratios of.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from robid_core.robot.file.part import NonNegative, Part, Positive, refusal

MINUTE_OF_ARC = np.pi / 10800  # rad
LOST_MOTION_TORQUE = 0.03  # of the rated torque, both ways: at what makers measure lost motion
GEAR_DAMPING_RATIO = 0.03  # of a rotor swinging on its gear; 0.020 to 0.034 in the packaged six_axis
BEARING_DAMPING_RATIO = (
    0.015  # of the stretched arm swinging on a bearing; 0.011 to 0.017 in the packaged six_axis
)
CURVE = "transmission.piecewise_linear"  # the effect that bends the linear spring to the sheet's curve

Ratio = Annotated[float, Field(gt=0, lt=1)]


class GearSheet(Part):
    """A gear's data sheet, everything at the output; stiffness as K1, K2, K3 or one K, in either unit."""

    K1_nm_per_rad: Positive | None = None
    """Stiffness up to the torque T1, N m/rad."""
    K2_nm_per_rad: Positive | None = None
    """Stiffness from T1 to T2, N m/rad."""
    K3_nm_per_rad: Positive | None = None
    """Stiffness above T2, N m/rad."""
    K_nm_per_rad: Positive | None = None
    """Stiffness where the sheet has one only, N m/rad."""
    K1_nm_per_arcmin: Positive | None = None
    """Stiffness up to the torque T1, N m per minute of arc."""
    K2_nm_per_arcmin: Positive | None = None
    """Stiffness from T1 to T2, N m per minute of arc."""
    K3_nm_per_arcmin: Positive | None = None
    """Stiffness above T2, N m per minute of arc."""
    K_nm_per_arcmin: Positive | None = None
    """Stiffness where the sheet has one only, N m per minute of arc."""
    T1: Positive | None = None
    """Torque at which K1 ends, N m."""
    T2: Positive | None = None
    """Torque at which K2 ends, N m."""
    lost_motion_arcmin: NonNegative = 0.0
    """Lost motion from -3 % to +3 % of the rated torque, minutes of arc."""
    rated_torque: Positive | None = None
    """Rated torque, N m."""
    ratcheting_torque: Positive | None = None
    """Torque at which teeth jump, N m; only checked: the simulator has no ratcheting."""
    damping: NonNegative | None = None
    """Damping beside the stiffness, N m s/rad; in place of damping_ratio."""
    damping_ratio: Ratio | None = None
    """Damping ratio of the rotor swinging on the gear against a held arm."""

    @model_validator(mode="after")
    def _one_curve(self) -> GearSheet:
        given = {
            key: (unit, value)
            for key in ("K", "K1", "K2", "K3")
            for unit in ("rad", "arcmin")
            if (value := getattr(self, f"{key}_nm_per_{unit}")) is not None
        }
        if set(given) not in ({"K"}, {"K1", "K2", "K3"}) or len({unit for unit, _ in given.values()}) > 1:
            names = ", ".join(f"{key}_nm_per_{unit}" for key, (unit, _) in given.items()) or "none"
            raise refusal(f"stiffness is given as {names}; give K1, K2 and K3, or K alone, in one unit")
        if "K1" in given and (self.T1 is None or self.T2 is None):
            raise refusal("K1, K2 and K3 have no torques where they end; give T1 and T2 in N m")
        if "K" in given and (self.T1 is not None or self.T2 is not None):
            raise refusal("T1 and T2 part three ranges of stiffness; give K1, K2 and K3 instead of K")
        _rising({"T1": self.T1, "T2": self.T2, "ratcheting_torque": self.ratcheting_torque})
        _rising({"rated_torque": self.rated_torque, "ratcheting_torque": self.ratcheting_torque})
        if self.lost_motion_arcmin > 0:
            if self.rated_torque is None:
                raise refusal(
                    "lost_motion_arcmin is measured at 3 % of the rated torque; give rated_torque in N m"
                )
            if self.free_play < 0:
                elastic = (self.lost_motion_arcmin * MINUTE_OF_ARC - self.free_play) / MINUTE_OF_ARC
                raise refusal(
                    f"lost_motion_arcmin {self.lost_motion_arcmin:g} is less than the gear winds elastically from -3 "
                    f"to +3 % of {self.rated_torque:g} N m, {elastic:.3g} minutes of arc; check unit and rated torque"
                )
        _one_damping(self.damping, self.damping_ratio)
        return self

    @property
    def stiffness(self) -> tuple[float, float, float]:
        """Stiffness of the three ranges, N m/rad; equal where the sheet has one."""
        values = []
        for key in ("K1", "K2", "K3"):
            per_radian = getattr(self, f"{key}_nm_per_rad") or self.K_nm_per_rad
            per_minute = getattr(self, f"{key}_nm_per_arcmin") or self.K_nm_per_arcmin or 0.0
            values.append(float(per_radian or per_minute / MINUTE_OF_ARC))
        return values[0], values[1], values[2]

    @property
    def torques(self) -> tuple[float, float]:
        """Torques at which the ranges end, N m; 10 and 100 % of the rated torque where the sheet has one stiffness."""
        rated = self.rated_torque or 1.0
        return self.T1 or 0.1 * rated, self.T2 or rated

    @property
    def free_play(self) -> float:
        """Angle that is lost without torque, rad: lost motion less what winds elastically within +-3 %.

        Makers read both from one hysteresis loop, between its middle at -3 % and at +3 % of the rated torque.
        """
        return self.lost_motion_arcmin * MINUTE_OF_ARC - 2 * self.wind_up(
            LOST_MOTION_TORQUE * (self.rated_torque or 0.0)
        )

    def wind_up(self, torque: float) -> float:
        """Elastic angle at a torque >= 0 along the three ranges, rad."""
        (k1, k2, k3), (t1, t2) = self.stiffness, self.torques
        return min(torque, t1) / k1 + max(min(torque, t2) - t1, 0.0) / k2 + max(torque - t2, 0.0) / k3

    @property
    def linear_stiffness(self) -> float:
        """Stiffness of the linear model, N m/rad: K2.

        A robot at work stands between T1 and T2, loaded by gravity and acceleration, and the model is linearised there:
        what small vibrations feel is the slope of that range. (The secant at the rated torque, which the static
        deflection asks for, mixes in the soft first range; the effect puts the curve back where it is simulated.)
        """
        return self.stiffness[1]

    def linear_damping(self, reflected_inertia: float) -> float:
        """Damping of the linear model, N m s/rad: 2 zeta sqrt(K2 J), J the rotor's inertia at the output in kg m^2."""
        if self.damping is not None:
            return self.damping
        ratio = GEAR_DAMPING_RATIO if self.damping_ratio is None else self.damping_ratio
        return float(2 * ratio * np.sqrt(self.linear_stiffness * reflected_inertia))

    def curve(self) -> dict[str, float]:
        """Return the parameters of the effect `transmission.piecewise_linear`; empty where the sheet is linear."""
        (k1, k2, k3), (t1, t2) = self.stiffness, self.torques
        if k1 == k2 == k3 and self.lost_motion_arcmin == 0:
            return {}
        return {
            "stiffness_1": k1,
            "stiffness_2": k2,
            "stiffness_3": k3,
            "torque_1": t1,
            "torque_2": t2,
            "lost_motion": self.free_play if self.lost_motion_arcmin else 0.0,
        }


class BearingSheet(Part):
    """Moment rigidity of the bearing behind a joint: the same in every direction across the joint's axis."""

    moment_rigidity_nm_per_rad: Positive | None = None
    """Moment rigidity, N m/rad."""
    moment_rigidity_nm_per_arcmin: Positive | None = None
    """Moment rigidity, N m per minute of arc."""
    damping: NonNegative | None = None
    """Damping beside the stiffness, N m s/rad; in place of damping_ratio."""
    damping_ratio: Ratio | None = None
    """Damping ratio of the arm behind the joint, stretched out, swinging on the bearing."""

    @model_validator(mode="after")
    def _one_rigidity(self) -> BearingSheet:
        if (self.moment_rigidity_nm_per_rad is None) == (self.moment_rigidity_nm_per_arcmin is None):
            raise refusal("give moment_rigidity_nm_per_arcmin or moment_rigidity_nm_per_rad, one of the two")
        _one_damping(self.damping, self.damping_ratio)
        return self

    @property
    def stiffness(self) -> float:
        """Stiffness about each direction across the axis, N m/rad."""
        if self.moment_rigidity_nm_per_rad is not None:
            return self.moment_rigidity_nm_per_rad
        return float((self.moment_rigidity_nm_per_arcmin or 0.0) / MINUTE_OF_ARC)

    def linear_damping(self, outboard_inertia: float) -> float:
        """Damping, N m s/rad: 2 zeta sqrt(K J) with the inertia J of the stretched arm behind the joint, kg m^2."""
        if self.damping is not None:
            return self.damping
        ratio = BEARING_DAMPING_RATIO if self.damping_ratio is None else self.damping_ratio
        return float(2 * ratio * np.sqrt(self.stiffness * outboard_inertia))


def _one_damping(damping: float | None, ratio: float | None) -> None:
    if damping is not None and ratio is not None:
        raise refusal(f"damping {damping:g} and damping_ratio {ratio:g} are given; keep one of the two")


def _rising(torques: dict[str, float | None]) -> None:
    given = [(name, value) for name, value in torques.items() if value is not None]
    for (first, low), (second, high) in pairwise(given):
        if low >= high:
            raise refusal(f"{first} {low:g} N m is not below {second} {high:g} N m; check the sheet")
