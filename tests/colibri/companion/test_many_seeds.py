"""Over a bad link, with sensors and in turbulence, fifty times: nothing is lost, and each keeps to its track."""

import pytest

from colibri.companion.settings import CompanionSettings
from colibri.sitl.backends.link_faults import Trouble
from colibri.sitl.backends.setting import setting_of
from colibri.sitl.session import Flights
from tests.colibri.companion.in_memory import Ride


@pytest.mark.long
@pytest.mark.parametrize("seed", range(50))
def test_a_bad_link_loses_no_flight(seed: int) -> None:
    with Flights(setting_of([{"feedback": "sensors", "turbulence": "light", "seed": seed}]), None) as flights:
        sitl = flights.begin()
        track = "lemniscate:lap=8" if seed % 2 else "spiral"
        settings = CompanionSettings(may_arm=True, duration_s=18.0)
        ride = Ride(sitl, track, settings, trouble=Trouble(delay_s=0.03, jitter_s=0.01, loss=0.05), seed=seed)
        ended = ride.to_the_end(80.0)
        assert ended.in_order, ended.why
        print(f"{track} seed {seed}: {ride.companion.errors.rmse_m():.4f} m, at most {ride.companion.errors.max_m:.4f}")  # noqa: T201
        assert ride.companion.errors.rmse_m() <= 0.15
