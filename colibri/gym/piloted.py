"""Episodes through the whole autopilot: modes, limits, failsafes and, on sensors, the estimator."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from msgspec import structs
from numpy.random import Generator

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.parts.policy_interface import take
from colibri.autopilot.control.profile import Profile, load_profile
from colibri.autopilot.core.copter import Copter, copter_autopilot
from colibri.autopilot.ground.stations import StationSettings
from colibri.campaigns.factors import is_number
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.errors import shown, unknown
from colibri.common.rotations import earth_from_body, quaternion_from_euler
from colibri.common.types import Array, Vector
from colibri.flights.flight import SteppedFlight, direct_flight
from colibri.gym import kernels
from colibri.gym.arguments import GymError, within
from colibri.gym.episodes import Begun, Episodes, EpisodesSnapshot
from colibri.mavlink.hil.faults import MOTOR, OFF, Fault
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.world_changes import WindChange
from colibri.mavlink.node.service import Peer
from colibri.mavlink.setpoints.setpoints import AttitudeSetpoint, OffboardSetpoint, PositionSetpoint
from colibri.plant.physics.start import IntegrationError, Start
from colibri.plant.spec import WorldSpec

OBSERVATIONS = ("truth", "estimate")
SETTLE_S = 3.0  # flown at the start of the reference, once for each environment
_READY_WITHIN_S = 60.0
_COMPANION = Peer(0, 255, 190)
_PLACES = ("x", "y", "z")


class PilotedEpisodes(Episodes):
    """Episodes of one vehicle that its autopilot flies in mode offboard; arguments as in docs/gym.md."""

    near: Mapping[str, Any] = {f"start.{key}": {"uniform": [-0.5, 0.5]} for key in _PLACES}

    def __init__(
        self,
        count: int = 1,
        *,
        observation: str = "truth",
        profile: Any = "flight",
        rate: float = 50.0,
        max_velocity: Sequence[float] = (5.0, 5.0, 2.0, 2.0),
        max_offset_m: float = 2.0,
        max_tilt_deg: float = 35.0,
        **options: Any,
    ) -> None:
        if observation not in OBSERVATIONS:
            raise GymError(unknown("observation", observation, OBSERVATIONS))
        if not isinstance(max_velocity, Sequence) or len(max_velocity) != 4 or not all(map(is_number, max_velocity)):
            raise GymError(f'max_velocity must be four numbers, m/s and rad/s, not "{shown(max_velocity)}"')
        for value in max_velocity:
            within("max_velocity", value, 0.01, 50.0, "m/s or rad/s")
        within("max_offset_m", max_offset_m, 0.01, 100.0, "m")
        within("max_tilt_deg", max_tilt_deg, 1.0, 60.0, "degrees")
        self._estimates = observation == "estimate"
        super().__init__(count, rate=rate, **options)
        self._max_velocity, self._max_offset_m = np.array(max_velocity, dtype=np.float64), max_offset_m
        self._max_tilt_rad = np.radians(max_tilt_deg).item()
        self._throws = any(key.startswith("start.") and key not in self.near for key in (*self._fixed, *self._draws))
        if self._throws and self._estimates:
            raise GymError("draw: observation estimate begins in hover: of start only x, y and z can be drawn")
        self._track = self.reference
        self._shift = np.zeros(3)
        self._flight = self._made(profile)
        if rate * 1e-6 * self._flight.plant.interval_us > 1.0:
            most = 1e6 / self._flight.plant.interval_us
            raise GymError(f'rate must be at most that of the frames, {most:g} Hz, not "{rate:g}"')
        self._settle()
        self._begun_us = self._flight.time_us
        self._settled = self._flight.snapshot()

    def info(self) -> dict[str, Any]:
        return {**super().info(), "mode": str(self._flight.autopilot.stages.pilot.state.mode)}

    def snapshot(self) -> EpisodesSnapshot:
        flight = self._flight
        kept = (self, flight.snapshot(), self._shift.copy())
        return super().snapshot()._replace(flight=kept)

    def restore(self, snapshot: EpisodesSnapshot, chances: Sequence[Generator]) -> None:
        if not isinstance(snapshot, EpisodesSnapshot) or snapshot.flight is None or snapshot.flight[0] is not self:
            raise GymError("snapshot must come from snapshot() of this environment: its flight is restored in place")
        super().restore(snapshot, chances)
        _, flight, shift = snapshot.flight
        flight.restore()
        self._move(shift)

    def _made(self, profile: Any) -> SteppedFlight[Copter]:
        flown, feedback = self._in_step(load_profile(profile)), Feedback.SENSORS if self._estimates else Feedback.STATE
        x, y, z = self._first[:3].tolist()
        settings = StationSettings(1, "px4", DEFAULT_ORIGIN, feedback=feedback, reports=False)
        values = {"MIS_TAKEOFF_ALT": z}
        autopilot = copter_autopilot(flown, self.vehicle, settings, lambda: 0.0, values=values)
        start = Start(x=x, y=y) if self._estimates else Start(x=x, y=y, z=z, rotors=self.vehicle.hover_rpm)
        return direct_flight(autopilot, WorldSpec(), self.vehicle, feedback, start)

    def _in_step(self, profile: Profile) -> Profile:
        """Return the profile with the control interval nearest to its own that divides that of the actions."""
        law, interval_ms = profile.controller, round(self.interval_s * 1e3)
        own_s = profile.table(law).get("control_interval_s", 1.0)
        simulation = structs.replace(profile.simulation, frame_interval_s=None)
        if own_s > self.interval_s:
            return structs.replace(profile, simulation=simulation)
        fitting = [ms for ms in range(1, interval_ms + 1) if interval_ms % ms == 0]
        ms = min(fitting, key=lambda ms: (abs(ms - own_s * 1e3), -ms))
        if self._estimates and ms % 2 == 0:  # only the estimator has a frame between two control samples
            simulation = structs.replace(simulation, frame_interval_s=0.0005 * ms)
        key = f"controllers.{law}.control_interval_s"
        alone = structs.replace(profile, simulation=structs.replace(simulation, frame_interval_s=None))
        return structs.replace(alone.replace(key, 0.001 * ms), simulation=simulation)

    def _settle(self) -> None:
        """Fly to the start of the reference in mode offboard, until all has settled."""
        flight, pilot = self._flight, self._flight.autopilot.stages.pilot
        flight.step()
        until_us = round(_READY_WITHIN_S * 1e6)
        while self._estimates and (pilot.sensed.vehicle is None or pilot.readiness.refusals()):
            flight.step()
            if flight.time_us > until_us:
                why = "; ".join(pilot.readiness.refusals())
                raise GymError(f"the vehicle is not ready to arm after {_READY_WITHIN_S:g} s: {why}")
        if self._estimates:
            pilot.select(Mode.TAKEOFF, {})
            pilot.arm({})
            while pilot.state.mode is not Mode.HOLD:
                flight.step()
                if flight.time_us > 2 * until_us or not pilot.state.armed:
                    raise GymError("the vehicle does not reach the start of the track")
        x, y, z = self._first[:3].tolist()
        here = PositionSetpoint((x, y, z), yaw_rad=0.0)
        self._send(here)
        pilot.select(Mode.OFFBOARD, {})
        until_us = flight.time_us + round(SETTLE_S * 1e6)
        while flight.time_us < until_us:
            self._send(here)
            flight.step()

    def _send(self, setpoint: OffboardSetpoint) -> None:
        now_us = self._flight.time_us
        self._flight.autopilot.stages.stations.offboard.keep(_COMPANION, setpoint._replace(time_us=now_us), now_us)

    def _look(self) -> None:
        world, x = self._flight.plant.world, self.x[0]
        x[:13], x[13:-1], x[-1] = world.state, world.rotor_speeds, world.charge_used_ah

    def _begin(self, n: int, begun: Begun) -> None:
        self._settled.restore()
        plant, chance = self._flight.plant, self._chances[n]
        assert chance is not None, "an episode is drawn"
        plant.become(begun.vehicle, int(chance.integers(2**31)))
        plant.inject([WindChange(*begun.wind)])
        if begun.lost >= 0:
            plant.inject([Fault(MOTOR, OFF, begun.lost + 1)])
        if self._throws:
            x = begun.x.tolist()
            place = plant.world.state[6:9]
            plant.world = plant.world._replace(state=(*x[:6], *place, *x[9:13]))
        self._move(begun.x[6:9] - self._first[:3])
        self._last[n] = 0.0
        self._look()

    def _move(self, shift: Array) -> None:
        """Move the reference: the settled vehicle is then at `shift` from its start."""
        self._shift = shift
        self.reference = self._track.copy()
        self.reference[:, :3] -= shift

    def _seen(self, n: int) -> Array:
        x: Array = self.x[n]
        known = self._flight.autopilot.stages.state_source.last
        if not self._estimates or known is None:
            return x
        seen, (w, i, j, k) = x.copy(), known.attitude
        seen[:3] = earth_from_body((w, -i, -j, -k), known.velocity_enu_m_s)
        seen[3:13] = (*known.rate_flu_rad_s, *known.position_enu_m, *known.attitude)
        return seen

    def _advance(self, actions: Array) -> None:
        self._ends[0], self._rewards[0] = 0, 0.0
        if not self.flying[0]:
            return
        self.steps[0] += 1
        x, y, z = self.x[0, 6:9].tolist()
        change = take(actions[0], self._last[0], self._older[0])
        self._ends[0], self._rewards[0] = kernels.BAD_ACTION, kernels.LOST
        if change >= 0.0:
            self._send(self._setpoint(self._last[0]))
            until_us = self._begun_us + round(self.steps[0] * self.interval_s * 1e6)
            try:
                while self._flight.time_us < until_us:
                    self._flight.step()
            except IntegrationError:
                self._ends[0] = kernels.NOT_FINITE
                return
            self._look()
            self._judge(change, (x, y, z))
        self._observe(0)

    def _judge(self, change: float, before: Vector) -> None:
        x, k, limits = self.x[0], self.at[0], (self._limit_m, self._floor_m)
        if self.gate_m:
            judged = kernels.judge_race(x, before, change, self.reference, k, self.gate_m, *limits)
            reward, end, self._passed[0] = judged
        else:
            reward, end = kernels.judge(x, change, self.reference, k, *limits)
        if end == 0 and not self._flight.autopilot.stages.pilot.state.armed:
            reward, end = kernels.LOST, kernels.DISARMED
        self._rewards[0], self._ends[0] = reward, end

    def _setpoint(self, action: Array) -> OffboardSetpoint:
        a, b, c, d = action.tolist()
        if self.action == "attitude":
            attitude = quaternion_from_euler(b * self._max_tilt_rad, c * self._max_tilt_rad, d * np.pi)
            return AttitudeSetpoint(attitude, _NO_RATES, 0.5 * (a + 1.0))
        if self.action == "velocity":
            vx, vy, vz, rate = (action * self._max_velocity).tolist()
            return PositionSetpoint(velocity_m_s=(vx, vy, vz), yaw_rate_rad_s=rate)
        offset = self._max_offset_m * action[:3]
        now = self.reference[self._passed[0] if self.gate_m else self.steps[0] - 1]
        x, y, z = (now[:3] + offset).tolist()
        vx, vy, vz = (0.0, 0.0, 0.0) if self.gate_m else now[3:6].tolist()
        return PositionSetpoint((x, y, z), (vx, vy, vz), yaw_rad=d * np.pi)


_NO_RATES: Vector = (float("nan"), float("nan"), float("nan"))
