"""Missions: flown as uploaded, refused where they cannot be."""

from colibri.autopilot.commander.rules.modes import Mode
from colibri.sitl import mission_items as items
from colibri.sitl.flight_record import Columns
from colibri.sitl.vehicle import Sitl
from tests.scenarios.words import conditions as see
from tests.scenarios.words import steps as do
from tests.scenarios.words.scenario import Scenario

SQUARE = ((0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0), (0.0, 0.0))
CORRIDOR = [items.waypoint(east, north, 10.0, within_m=1.0) for east, north in SQUARE]
STEPS = [items.waypoint(5.0 * (n % 2), 0.0, 5.0) for n in range(4)]
LONG = [items.waypoint(0.5 * n, 1.0 * (n % 2), 5.0, within_m=0.5) for n in range(20)]
ALONG_THE_CORRIDOR = do.upload(items.takeoff(10.0), *CORRIDOR, items.land(0.0, 0.0)), do.start_mission
FIELD = items.polygon([(-10.0, -10.0), (10.0, -10.0), (10.0, 10.0), (-10.0, 10.0)])


def off_the_square(columns: Columns) -> float:
    """Return the figure: how far it was from the sides of the square, once it had come to it."""
    flown = do.places(columns)
    x, y = flown[flown[:, 2] > 9.5][:, 0], flown[flown[:, 2] > 9.5][:, 1]
    inside = (x > 0.0) & (x < 20.0) & (y > 0.0) & (y < 20.0)
    sides = [abs(x), abs(x - 20.0), abs(y), abs(y - 20.0)]
    nearest = sides[0]
    for side in sides[1:]:
        nearest = nearest.clip(max=side)
    outside = ((-x).clip(min=0.0) + (x - 20.0).clip(min=0.0)) + ((-y).clip(min=0.0) + (y - 20.0).clip(min=0.0))
    return float((nearest * inside + outside * ~inside).max())


@do.word
def reads_back(sitl: Sitl, count: int) -> None:
    sitl.gcs.forget()
    ask = do.at_every(0.5, lambda sitl: sitl.send("MISSION_REQUEST_LIST", sitl.system, 1, 0))
    sitl.wait_until(lambda: ask(sitl) or sitl.heard("MISSION_COUNT"), within=10.0, what="MISSION_COUNT")
    assert sitl.gcs.latest("MISSION_COUNT").count == count


def changes_mode_while_it_uploads(sitl: Sitl) -> None:
    sent = sitl.gcs.begin_upload([item.on_wire(sitl.origin) for item in LONG])
    sitl.run(0.05)
    assert sent.result is None
    sitl.select(Mode.LAND)
    sitl.wait_until(lambda: sent.result is not None, within=20.0, what="the upload")
    assert sent.result == 0
    assert sitl.mode is Mode.LAND


SCENARIOS = (
    Scenario(
        name="keeps-to-its-corridor",
        peer="PX4: 5 m to either side, at most 500 s",
        holds="1.1 m to either side, 80 s",
        steps=(
            *ALONG_THE_CORRIDOR,
            do.until(see.DISARMED, within=80.0),
            do.measured("the distance from the square", off_the_square, 1.1),
            do.check(see.over(0.0, 0.0, 0.1)),
        ),
    ),
    Scenario(
        name="steps-of-five-metres",
        peer="PX4: to 0.3 m within 10 s each, home within 2 m",
        holds="0.3 m within 7 s each, home within 0.05 m",
        steps=(
            do.upload(items.takeoff(5.0), *STEPS, items.return_home()),
            do.start_mission,
            do.until(see.near((0.0, 0.0, 5.0), 0.3), within=10.0),
            *(do.until(see.near((5.0 * (n % 2), 0.0, 5.0), 0.3), within=7.0) for n in range(1, 4)),
            do.until(see.DISARMED, within=90.0),
            do.check(see.over(0.0, 0.0, 0.05)),
        ),
        setting={"params": {"RTL_RETURN_ALT": 6.0}},
    ),
    Scenario(
        name="upload-over-a-lossy-link",
        peer="MAVSDK: 5 % loss, 20 items, up = down",
        holds="20 % loss each way, 20 items, correct count",
        steps=(do.trouble("ground", loss=0.2), do.upload(*LONG), do.trouble("ground", loss=0.0), reads_back(20)),
    ),
    Scenario(
        name="pause-and-resume",
        peer="ours",
        holds="stops within 4 s of the pause, then ends the mission",
        steps=(
            do.upload(items.takeoff(5.0), items.waypoint(25.0, 0.0, 5.0), items.waypoint(25.0, 5.0, 5.0)),
            do.start_mission,
            do.until(see.away(8.0), within=20.0),
            do.select(Mode.HOLD),
            do.until(see.slower(0.05), within=4.0),
            do.hold(see.every(see.mode(Mode.HOLD), see.slower(0.1)), for_=2.0),
            do.select(Mode.MISSION),
            do.until(see.near((25.0, 5.0, 5.0), 0.3), within=20.0),
            do.until(see.mode(Mode.HOLD), within=3.0),
        ),
    ),
    Scenario(
        name="mode-change-during-upload",
        peer="ours",
        holds="the upload completes in the selected mode",
        steps=(changes_mode_while_it_uploads, do.until(see.DISARMED, within=20.0), reads_back(20)),
        setting={"airborne": 5.0},
    ),
    Scenario(
        name="mission-outside-the-fence",
        peer="AP: refused",
        holds="refused, with the item",
        steps=(
            do.upload_fence(FIELD),
            do.upload(items.takeoff(5.0), items.waypoint(50.0, 0.0, 5.0)),
            do.run(0.3),
            do.refused(do.start_mission, "outside the geofence"),
            do.check(see.DISARMED),
        ),
    ),
    Scenario(
        name="empty-mission",
        peer="ours",
        holds="refused with the reason",
        steps=(do.refused(do.start_mission, "there is no mission"), do.check(see.DISARMED)),
    ),
    Scenario(
        name="mission-jump",
        peer="ours",
        holds="items 1 and 2 twice, then the last",
        steps=(
            do.upload(
                items.takeoff(5.0),
                items.waypoint(4.0, 0.0, 5.0),
                items.waypoint(0.0, 0.0, 5.0),
                items.jump(1, 1),
                items.waypoint(0.0, 3.0, 5.0),
            ),
            do.start_mission,
            do.until(see.near((4.0, 0.0, 5.0), 0.3), within=20.0),
            do.until(see.near((0.0, 0.0, 5.0), 0.3), within=10.0),
            do.until(see.near((4.0, 0.0, 5.0), 0.3), within=10.0),
            do.until(see.near((0.0, 3.0, 5.0), 0.3), within=15.0),
            do.until(see.mode(Mode.HOLD), within=3.0),
        ),
    ),
    Scenario(
        name="flies-a-mission-on-sensors-in-wind",
        peer="PX4: 5 m to either side of the corridor",
        holds="2.5 m to either side, lands within 2 m",
        steps=(
            *ALONG_THE_CORRIDOR,
            do.until(see.DISARMED, within=90.0),
            do.measured("the distance from the square", off_the_square, 2.5),
            do.check(see.over(0.0, 0.0, 2.0)),
        ),
        setting={"feedback": "sensors", "wind": "5@270", "turbulence": "light", "seed": 4},
    ),
    Scenario(
        name="mission-speed-change",
        peer="ours",
        holds="5 m/s, then 8 m/s on the leg after the speed item",
        steps=(
            do.upload(
                items.takeoff(5.0),
                items.waypoint(25.0, 0.0, 5.0, within_m=1.0),
                items.change_speed(8.0),
                items.waypoint(25.0, 50.0, 5.0),
            ),
            do.start_mission,
            do.until(see.near((25.0, 0.0, 5.0), 1.0), within=25.0),
            do.measured("the speed", lambda columns: float(abs(columns["vx"]).max()), 5.05),
            do.until(see.near((25.0, 50.0, 5.0), 0.3), within=20.0),
            do.measured("the speed", lambda columns: float(abs(columns["vy"]).max()), 8.1, minimum=7.9),
        ),
    ),
)
