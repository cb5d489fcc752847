import pytest

from colibri.sitl.backends.setting import Setting, SettingError
from colibri.sitl.session import Fleet, Flights, begin_fleet


def test_all_fly_as_long_whoever_is_flown() -> None:
    with Flights(Setting(), None) as flights:
        fleet = begin_fleet(flights, 2)
        fleet[0].takeoff(1.0)
        assert fleet[0].time_us == fleet[1].time_us > 1_000_000
        fleet[1].takeoff(2.0, wait=False)
        fleet.run(0.5)
        fleet[1].step()
        assert fleet[0].time_us == fleet[1].time_us == fleet.time_us
        assert fleet[0].is_at((0.0, 0.0, 1.0))
        assert fleet[1].position[2] > 0.1


def test_a_vehicle_behind_catches_up_within_a_frame() -> None:
    with Flights(Setting(airborne=3.0), None) as flights:
        ahead = flights.begin()
        ahead.run(0.1)
        slow = flights.begin(profile="se3", system=2)  # its frames are of another length
        fleet = Fleet((slow, ahead))
        frame_us = {sitl: -sitl.time_us for sitl in fleet}
        assert abs(slow.time_us - ahead.time_us) < 10_000
        for _ in range(7):
            fleet.step()
            assert abs(slow.time_us - ahead.time_us) < 10_000
        assert all(frame_us[sitl] + sitl.time_us > 0 for sitl in fleet)


def test_places_are_of_one_frame() -> None:
    with Flights(Setting(start={"y": 1.0}), None) as flights:
        fleet = begin_fleet(flights, 2, spacing=3.0)
        assert [sitl.position[:2] for sitl in fleet] == [(0.0, 1.0), (3.0, 1.0)]
        (third,) = begin_fleet(flights, 1, places=[(-1.0, 2.0)], start="x=0.5")
        assert third.position[:2] == (-0.5, 2.0)
        assert [sitl.system for sitl in flights.flown] == [1, 2, 3]
        with pytest.raises(SettingError, match="places: expected one for each of 2 vehicles, found 1"):
            begin_fleet(flights, 2, places=[(0.0, 0.0)])
        with pytest.raises(SettingError, match="a fleet has at least one vehicle, not 0"):
            begin_fleet(flights, 0)
