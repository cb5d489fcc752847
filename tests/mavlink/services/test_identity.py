"""Who the autopilot says that it is: what clients ask of AUTOPILOT_VERSION."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.mavlink.node.service import Send
from colibri.mavlink.services.identity import GENERIC, PX4, autopilot_version, banner, version_of
from colibri.mavlink.wire.dialect import mav
from tests.support.messages import on_the_wire


def test_it_says_that_it_is_colibri() -> None:
    """Clients read a vendor's version from the first three custom bytes: patch, minor, major."""
    (version,) = on_the_wire([Send("AUTOPILOT_VERSION", autopilot_version(PX4, (1, 2, 3), 7))])
    fields = version.fields
    assert bytes(fields.flight_custom_version) == b"\x03\x02\x01Colib"
    assert bytes(fields.uid2) == b"Colibri" + bytes(10) + b"\x07"
    assert fields.uid == 7
    assert fields.middleware_sw_version == 0x01020300
    assert banner(PX4, "1.2.3") == "Colibri 1.2.3, speaking as PX4"
    assert banner(GENERIC, "1.2.3") == "Colibri 1.2.3"


def test_ground_stations_find_no_version_to_complain_about() -> None:
    """QGroundControl wants PX4 1.4.1 or later, and compares official releases with the latest."""
    shown = autopilot_version(PX4, (0, 1, 0), 1)[1]
    assert shown >> 8 >= 0x010401
    assert shown & 0xFF == mav.FIRMWARE_VERSION_TYPE_DEV
    assert autopilot_version(GENERIC, (0, 1, 2), 1)[1] == 0x00010200, "its own"


def test_missions_need_their_capability() -> None:
    capabilities = autopilot_version(GENERIC, (0, 1, 0), 1)[0]
    for bit in ("MISSION_INT", "COMMAND_INT", "FTP", "MISSION_FENCE", "MISSION_RALLY", "MAVLINK2"):
        assert capabilities & getattr(mav, f"MAV_PROTOCOL_CAPABILITY_{bit}"), bit


@pytest.mark.parametrize(
    ("text", "version"), [("0.1.0", (0, 1, 0)), ("1.2", (1, 2, 0)), ("1.2.3rc1", (1, 2, 0)), ("", (0, 0, 0))]
)
def test_versions(text: str, version: tuple[int, int, int]) -> None:
    assert version_of(text) == version


@given(st.text("0123456789.rc-²٣", max_size=20))
def test_any_text_is_some_version(text: str) -> None:
    on_the_wire([Send("AUTOPILOT_VERSION", autopilot_version(PX4, version_of(text), 255))])
