"""A TCP server, with pymavlink and with MAVSDK; MAVSDK with a vehicle that is no PX4."""

import socket
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import development as mavlink2

from tests.clients.support.client import run_script
from tools.harness.processes import vehicle


class Wire:
    def __init__(self, sock: socket.socket) -> None:
        self.write = sock.sendall


@pytest.mark.long
def test_a_client_of_the_tcp_server(tmp_path: Path) -> None:
    """Two at once; what it reads comes in pieces, as TCP cuts them."""
    with vehicle(tmp_path, links=("tcpin:127.0.0.1:0",), speed=4.0) as flown:
        address = ("127.0.0.1", flown.port)
        with socket.create_connection(address, 10.0) as one, socket.create_connection(address, 10.0) as other:
            for sock, own in ((one, 254), (other, 253)):
                mav = mavlink2.MAVLink(Wire(sock), own, 190)
                mav.robust_parsing = True
                mav.command_long_send(1, 1, mavlink2.MAV_CMD_REQUEST_MESSAGE, 0, 148, 0, 0, 0, 0, 0, 0)
                names: dict[str, int] = {}
                while not {"HEARTBEAT", "AUTOPILOT_VERSION", "COMMAND_ACK", "ATTITUDE"} <= names.keys():
                    for message in mav.parse_buffer(sock.recv(7)) or ():
                        names[message.get_type()] = getattr(message, "target_system", 0)
                assert names["COMMAND_ACK"] == own
                assert "BAD_DATA" not in names


@pytest.mark.long
def test_mavsdk_over_tcp(tmp_path: Path) -> None:
    with vehicle(tmp_path, links=("tcpin:127.0.0.1:0",), speed=3.0) as flown:
        run_script("flights.takeoff_and_land", f"tcpout://127.0.0.1:{flown.port}", tmp_path)
        flown.seen.wait_until_disarmed()
        assert 4.7 < max(sight.height_m for sight in flown.seen.sights) < 5.1


@pytest.mark.long
def test_mavsdk_with_a_generic_vehicle(tmp_path: Path) -> None:
    with vehicle(tmp_path, "--identity", "generic", speed=3.0) as flown:
        run_script("flights.generic", f"udpout://127.0.0.1:{flown.port}", tmp_path)
        flown.seen.wait_until_disarmed()
        assert 2.7 < max(sight.height_m for sight in flown.seen.sights) < 3.1
