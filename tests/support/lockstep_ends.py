"""Both ends of the lockstep protocol, with frames and commands for them."""

from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.hil.plant_status import NOTHING, PlantStatus, ReceivedFrame
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame

ADDRESS, STRANGER = ("autopilot", 1), ("stranger", 2)
INTERVAL_US = 100_000


def frame_at(time_us: int) -> StateFrame:
    return StateFrame(time_us, (0.0, 0.0, float(time_us)), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def command_at(time_us: int) -> ActuatorCommand:
    return ActuatorCommand(time_us, (0.25, 0.5, 0.75, 1.0), armed=True)


def call(autopilot: AutopilotEnd, plant: PlantEnd) -> None:
    autopilot.poll(0.0)
    for datagram in autopilot.take_outbox():
        plant.receive(datagram, ADDRESS, 0.0)
    for outgoing in plant.take_outbox():
        autopilot.receive(outgoing.datagram, 0.0)


def offered(plant: PlantEnd, frame: Frame, plant_status: PlantStatus = NOTHING) -> bytes:
    plant.offer(frame, 0.0, plant_status)
    (outgoing,) = plant.take_outbox()
    return outgoing.datagram


def answer_to(plant: PlantEnd, autopilot: AutopilotEnd, time_us: int) -> bytes:
    assert autopilot.receive(offered(plant, frame_at(time_us)), 0.0) == ReceivedFrame(frame_at(time_us))
    autopilot.answer(command_at(time_us))
    (answer,) = autopilot.take_outbox()
    return answer
