"""Links other than the one that calls by UDP: a TCP server, with pymavlink and with MAVSDK."""

import socket
from pathlib import Path

from pymavlink.dialects.v20 import development as mavlink2

from tests.clients.vehicle import vehicle


class Wire:
    """What pymavlink writes to."""

    def __init__(self, sock: socket.socket) -> None:
        """Write to a connection."""
        self.write = sock.sendall


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
