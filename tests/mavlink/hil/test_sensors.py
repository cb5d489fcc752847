"""HIL_SENSOR and HIL_GPS: round trips, the units and frames on the wire, and that no number is judged."""

from math import isnan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector
from colibri.mavlink.hil.sensors import FixType, GpsFix, SensorFrame, Updated, decode_sensors, encode_sensors
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Codec, Message
from tests.support.strategies import reals, vectors

FLOAT32 = 1e-6
ZERO = (0.0, 0.0, 0.0)
ALL = Updated.ACCELEROMETER | Updated.GYROSCOPE | Updated.MAGNETOMETER | Updated.BAROMETER
PLACE = Geodetic(47.397742, 8.545594, 488.0)
FIX = GpsFix(1_120_000, FixType.FIX_3D, PLACE, (1.5, -2.0, 0.25), 0.25, 0.5, 14)
FRAME = SensorFrame(1_240_000, ALL, (1.0, 2.0, 9.75), (0.5, -0.25, 0.125), (0.25, -0.125, -0.5), 95_000.0, 12.5, FIX)

ANY_FLOAT32 = st.floats(width=32)
GEODETIC = st.builds(Geodetic, reals(90.0), reals(180.0), reals(1e4))
FIXES = st.builds(
    GpsFix,
    st.integers(0, 2**64 - 1),
    st.integers(0, 255),
    GEODETIC,
    vectors(300.0),
    st.floats(0.0, 650.0),
    st.floats(0.0, 650.0),
    st.integers(0, 254),
)


def on_the_wire(frame: SensorFrame) -> list[Message]:
    codec = Codec(1, dialect.PLANT_COMPONENT)
    return codec.decode(b"".join(encode_sensors(codec, frame)))


def through_the_wire(frame: SensorFrame) -> SensorFrame:
    sensor, *gps = on_the_wire(frame)
    return decode_sensors(sensor, *gps)


@given(
    st.builds(
        SensorFrame,
        st.integers(0, 2**64 - 1),
        st.integers(0, ALL),
        vectors(),
        vectors(),
        vectors(),
        st.floats(0.0, 2e5),
        reals(100.0),
        FIXES | st.none(),
        st.none(),
    )
)
def test_round_trip(frame: SensorFrame) -> None:
    decoded = through_the_wire(frame)
    assert (decoded.time_us, decoded.updated) == (frame.time_us, frame.updated)
    for name in ("specific_force_flu_m_s2", "rate_flu_rad_s", "magnetic_field_flu_gauss"):
        assert getattr(decoded, name) == pytest.approx(getattr(frame, name), rel=FLOAT32, abs=1e-6)
    assert decoded.pressure_pa == pytest.approx(frame.pressure_pa, rel=FLOAT32, abs=1e-6)
    assert decoded.temperature_c == pytest.approx(frame.temperature_c, rel=FLOAT32, abs=1e-6)
    if frame.gps is None:
        assert decoded.gps is None
        return
    told, wanted = decoded.gps, frame.gps
    assert told is not None
    assert (told.time_us, told.fix_type, told.satellites) == (wanted.time_us, wanted.fix_type, wanted.satellites)
    assert told.place[:2] == pytest.approx(wanted.place[:2], abs=0.51e-7)
    assert told.place.altitude_m == pytest.approx(wanted.place.altitude_m, abs=0.51e-3)
    assert told.velocity_enu_m_s == pytest.approx(wanted.velocity_enu_m_s, abs=0.51e-2)
    assert told.horizontal_accuracy_m == pytest.approx(wanted.horizontal_accuracy_m, abs=0.51e-2)
    assert told.vertical_accuracy_m == pytest.approx(wanted.vertical_accuracy_m, abs=0.51e-2)


def test_sensors_are_frd_and_hectopascal_on_the_wire() -> None:
    sensor, _ = on_the_wire(FRAME)
    s = sensor.fields
    assert sensor.name == "HIL_SENSOR"
    assert (s.xacc, s.yacc, s.zacc) == (1.0, -2.0, -9.75)
    assert (s.xgyro, s.ygyro, s.zgyro) == (0.5, 0.25, -0.125)
    assert (s.xmag, s.ymag, s.zmag) == (0.25, 0.125, 0.5)
    assert (s.abs_pressure, s.temperature, s.diff_pressure) == (950.0, 12.5, 0.0)
    assert s.pressure_alt == pytest.approx(540.3, abs=0.5)
    assert (s.time_usec, s.fields_updated, s.id) == (1_240_000, 0x1BFF, 0)


def test_gps_is_ned_and_whole_numbers_on_the_wire() -> None:
    _, gps = on_the_wire(FRAME)
    g = gps.fields
    assert gps.name == "HIL_GPS"
    assert (g.lat, g.lon, g.alt) == (473_977_420, 85_455_940, 488_000)
    assert (g.vn, g.ve, g.vd, g.vel) == (-200, 150, -25, 250)
    assert (g.eph, g.epv, g.cog) == (25, 50, 14313)
    assert (g.time_usec, g.fix_type, g.satellites_visible) == (1_120_000, 3, 14)


@pytest.mark.parametrize(
    ("velocity", "course"), [((0.0, 1.0, 0.0), 0), ((1.0, 0.0, 0.0), 9000), ((-1e-7, 1.0, 0.0), 0)]
)
def test_course_is_clockwise_from_north(velocity: Vector, course: int) -> None:
    fix = GpsFix(0, 3, PLACE, velocity, 1.0, 1.0, 9)
    _, gps = on_the_wire(SensorFrame(0, 0, velocity, velocity, velocity, 0.0, 0.0, fix))
    assert gps.fields.cog == course


def test_a_group_is_new_when_all_of_it_is() -> None:
    (sensor,) = on_the_wire(SensorFrame(0, 0x3 | Updated.GYROSCOPE, ZERO, ZERO, ZERO, 1e5, 15.0))
    frame = decode_sensors(sensor)
    assert frame.has(Updated.GYROSCOPE)
    assert not frame.has(Updated.ACCELEROMETER)


def test_unknown_accuracy_is_no_number() -> None:
    codec = Codec(1, dialect.PLANT_COMPONENT)
    data = codec.encode("HIL_GPS", 0, 3, 0, 0, 0, 65535, 65535, 0, 0, 0, 0, 0, 9)
    sensor, gps = codec.decode(b"".join(encode_sensors(codec, SensorFrame(0, 0, ZERO, ZERO, ZERO, 0.0, 0.0))) + data)
    fix = decode_sensors(sensor, gps).gps
    assert fix is not None
    assert isnan(fix.horizontal_accuracy_m)
    assert isnan(fix.vertical_accuracy_m)


@given(
    st.integers(0, 2**64 - 1),
    st.lists(ANY_FLOAT32, min_size=13, max_size=13),
    st.integers(0, 2**32 - 1),
    st.tuples(*[st.integers(-(2**31), 2**31 - 1)] * 3),
    st.lists(st.integers(-(2**15), 2**15 - 1), min_size=3, max_size=3),
    st.lists(st.integers(0, 2**16 - 1), min_size=4, max_size=4),
)
def test_whatever_comes_is_decoded_and_not_judged(
    time_us: int, numbers: list[float], updated: int, place: tuple[int, ...], velocity: list[int], rest: list[int]
) -> None:
    codec = Codec(1, dialect.PLANT_COMPONENT)
    data = codec.encode("HIL_SENSOR", time_us, *numbers, updated)
    data += codec.encode("HIL_GPS", time_us, 200, *place, *rest[:3], *velocity, rest[3], 255)
    sensor, gps = codec.decode(data)
    frame = decode_sensors(sensor, gps)
    assert frame.time_us == time_us
    assert frame.gps is not None
    assert frame.gps.place.latitude_deg == place[0] / 1e7
    told = [*frame.specific_force_flu_m_s2, *frame.rate_flu_rad_s, *frame.magnetic_field_flu_gauss]
    for value, sent in zip(told, numbers, strict=False):
        assert abs(value) == abs(sent) or isnan(sent)
