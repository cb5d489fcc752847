"""Faults on their way from a ground station to the plant and back: what is handed on, what is refused, and by whom."""

from math import nan

import pytest

from colibri.autopilot.ground.fault_injection import ANSWERED_WITHIN_US, Failures
from colibri.mavlink.hil.faults import COMMAND, GPS, MOTOR, OFF, WRONG, Fault
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.plant_status import FaultResult
from colibri.mavlink.node.service import Peer
from colibri.mavlink.services.command import DENIED, FAILED, PENDING, UNSUPPORTED, ReceivedCommand
from colibri.mavlink.wire.dialect import RESULT_ACCEPTED, RESULT_DENIED, RESULT_UNSUPPORTED, Refusal

PEER = Peer(0, 255, 190)


def asked(*params: float, now_us: int = 0) -> ReceivedCommand:
    p = (*params, *(0.0,) * (7 - len(params)))
    return ReceivedCommand(COMMAND, p[0], p[1], p[2], p[3], p[4], p[5], p[6], None, PEER, now_us)


@pytest.fixture
def failures() -> Failures:
    return Failures(Feedback.SENSORS, relays=True, motors=6)


def test_a_fault_is_injected_once_and_then_acknowledged(failures: Failures) -> None:
    command = asked(MOTOR, WRONG, 6.0, 0.5)
    assert failures.inject(command, enabled=True) == PENDING
    assert failures.take() == (Fault(MOTOR, WRONG, 6, (0.5, 0.0, 0.0, 0.0)),)
    assert failures.take() == ()
    assert failures.poll((), 8000) is None
    assert failures.poll((FaultResult(GPS, OFF, RESULT_ACCEPTED),), 8000) is None
    assert failures.poll((FaultResult(MOTOR, WRONG, RESULT_ACCEPTED),), 16000) == (command, None)
    assert failures.poll((FaultResult(MOTOR, WRONG, RESULT_ACCEPTED),), 24000) is None


@pytest.mark.parametrize("result", [RESULT_UNSUPPORTED, RESULT_DENIED])
def test_what_the_plant_refuses_is_refused(failures: Failures, result: int) -> None:
    failures.inject(asked(MOTOR, OFF), enabled=True)
    ended = failures.poll((FaultResult(MOTOR, OFF, result),), 8000)
    assert ended is not None
    refusal = ended[1]
    assert refusal is not None
    assert refusal.result == result
    assert refusal.reason.startswith("failure refused by the plant: ")


@pytest.mark.parametrize("now_us", [ANSWERED_WITHIN_US, -1])
def test_a_plant_that_does_not_answer_is_not_waited_for(failures: Failures, now_us: int) -> None:
    failures.inject(asked(MOTOR, OFF), enabled=True)
    ended = failures.poll((), now_us)
    assert ended is not None
    assert ended[1] == Refusal("failure refused: the plant does not answer", FAILED)


def test_faults_need_the_permission_of_the_parameter(failures: Failures) -> None:
    assert failures.inject(asked(MOTOR, OFF), enabled=False) not in (None, PENDING)
    assert failures.take() == ()


def test_sensor_faults_need_sensor_feedback_and_our_plant() -> None:
    by_state, elsewhere = Failures(Feedback.STATE, relays=True), Failures(Feedback.SENSORS, relays=False)
    refusal = by_state.inject(asked(GPS, OFF), enabled=True)
    assert refusal == Refusal("failure refused: flown by the state, not by sensors", UNSUPPORTED)
    refusal = elsewhere.inject(asked(MOTOR, OFF), enabled=True)
    assert refusal == Refusal("failure refused: this simulator does not change", UNSUPPORTED)
    assert by_state.take() == elsewhere.take() == ()


@pytest.mark.parametrize(
    ("params", "result"),
    [((nan, OFF), DENIED), ((MOTOR, 0.5), DENIED), ((MOTOR, WRONG, 1.0, -0.5), DENIED), ((MOTOR, 99.0), UNSUPPORTED)],
)
def test_impossible_numbers_are_refused(failures: Failures, params: tuple[float, ...], result: int) -> None:
    refusal = failures.inject(asked(*params), enabled=True)
    assert refusal is not None
    assert refusal.result == result
    assert refusal.reason
    assert failures.take() == ()
