"""What is kept of a vehicle, put together from its parts, and handed back to them after a restart."""

from collections.abc import Callable
from typing import TypeAlias

from autopilot.course import Course, Scene
from autopilot.kept import CourseRecord, Kept, Past, course_record
from autopilot.loop import ControlLoop
from autopilot.modes import Mode
from autopilot.pilot import Pilot
from autopilot.power import PowerMeter
from autopilot.rotor_loss import RotorLoss
from autopilot.senses import Senses
from autopilot.stations import Stations
from autopilot.supervisor import Supervisor
from mavlink.hil import StateFrame

Again: TypeAlias = Callable[[CourseRecord, Mode, Scene], Course]
"""Says how a mode goes on."""


class Keeper:
    """Keeps one vehicle's flight."""

    def __init__(
        self,
        maker: int,
        loop: ControlLoop,
        senses: Senses,
        pilot: Pilot,
        stations: Stations,
        power: PowerMeter,
        rotor_loss: RotorLoss,
        supervisor: Supervisor,
    ) -> None:
        """Keep what these parts of a vehicle know; `maker` is `maker_of` it."""
        self._maker = maker
        self._loop, self._senses = loop, senses
        self._pilot, self._stations = pilot, stations
        self._power, self._rotor_loss, self._supervisor = power, rotor_loss, supervisor

    def record(self, time_us: int) -> Kept:
        """Return the flight as it is now."""
        missions = self._stations.missions
        return Kept(
            self._maker,
            time_us,
            self._stations.commands.origin,
            missions.ids,
            missions.executor.record(),
            self._pilot.record(),
            course_record(self._pilot.course),
            self._loop.record(),
            self._power.charge_ah,
            self._power.energy_wh,
            self._senses.record(),
            self._rotor_loss.lost,
            self._rotor_loss.watch.speeds,
            self._supervisor.memory,
            self._stations.station_us is not None,
        )

    def resume(self, past: Past, frame: StateFrame, again: Again) -> None:
        """Have every part but the senses, who come before, go on with a flight at its next frame."""
        kept, plans = past
        stations, pilot = self._stations, self._pilot
        closely = kept.is_close_to(frame.time_us) and kept.maker == self._maker
        self._loop.resume(kept.loop, closely=closely)
        self._power.resume(kept.charge_ah, kept.energy_wh)
        stations.commands.origin = kept.origin
        stations.missions.resume(plans, kept.plan_ids, kept.mission)
        if kept.had_station:
            stations.expect_station(frame.time_us)
        state = self._loop.state(frame)
        pilot.resume(
            frame.time_us, state, kept.pilot, lambda mode, scene: again(kept.course, mode, scene), closely=closely
        )
        stations.missions.moved_origin()
        if pilot.state.armed:
            self._supervisor.memory = kept.failsafes
        if kept.rotor_lost is not None:
            flying = pilot.state.armed and not pilot.standing
            self._rotor_loss.resume(kept.rotor_lost, kept.rotor_speeds, state, pilot.ground_m, flying=flying)
            pilot.lose_rotor(kept.rotor_lost)
