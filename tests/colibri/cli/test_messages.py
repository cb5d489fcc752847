import re
import shlex
from pathlib import Path

import pytest

from colibri.cli.commands import COMMANDS, add_options
from colibri.common.errors import Error, InFlightError
from colibri.common.process.arguments import ArgumentParser
from tests.support.commands import Refused

LINK = "udpin:127.0.0.1:0"
MESSAGES = [
    ("bench --only nothing", ""),
    ("bench --runs 0", ""),
    ("bench --duration 0", ""),
    ("bench --duration 0.01", ""),
    ("bench --duration 1000000", ""),
    ("bench --out /nowhere/figures.json", ""),
    ("bench --against /nowhere", ""),
    (
        "campaign --track hover --set duration --out out",
        "expected KEY=VALUES, for example body.mass_kg=0.6:0.8:5, not duration",
    ),
    ("campaign --track hover --set latency=1 --set latency=2 --out out", "latency is given twice: give all values"),
    (
        "campaign --track hover --draw plant-vehicle.body.mass_kg=uniform:3 --out out",
        "plant-vehicle.body.mass_kg: uniform: expected [lowest, highest], not [3]",
    ),
    (
        "campaign --track hover --seeds 3-1 --out out",
        'seeds: must be FIRST-LAST, a number, or a list of different numbers, not "3-1"',
    ),
    ("campaign --track hover --workers 0 --out out", "workers: must be a whole number of at least 1, not 0"),
    ("campaign --track hover --workers 2 --dask tcp://127.0.0.1:1 --out out", "workers: not used with a cluster"),
    ("campaign --track hover --seeds 1-1000001 --out out", "1000001 flights: confirm with --yes"),
    ("campaign --track hovr --out out", "hovr"),
    ("campaign --profile flight --out out", "no track: add one"),
    ("campaign there-is-none.toml --out out", "there-is-none.toml: No such file or directory"),
    ("certify thesis --out out", "profile thesis: cascade cannot be certified: only lpv-mpc can"),
    ("certify flight --controller geometric-se3 --out out", "geometric-se3 cannot be certified"),
    ("certify thesis --controller lpv-mpc --out out", "profile thesis: has no numbers for lpv-mpc"),
    ("certify nonsense --out out", "nonsense"),
    ("certify flight --vehicle nonsense --out out", "nonsense"),
    ("certify flight --charge 1.5 --out out", "part of 1"),
    ("certify flight --moment 0 --out out", "above zero"),
    ("check-controller lpv-mcp", 'unknown controller "lpv-mcp" (did you mean "lpv-mpc"?)'),
    ("check-controller pid", 'unknown controller "pid" (choose cascade'),
    ("check-controller lpv-mpc --profile thesis", "profile thesis has no numbers for controller lpv-mpc"),
    ("check-controller lpv-mpc --profile fligt", 'unknown profile "fligt"'),
    ("check-controller lpv-mpc --vehicle dragonfly", 'unknown vehicle "dragonfly"'),
    ("check-controller lpv-mpc --only memories", 'unknown area "memories" (did you mean "memory"?)'),
    ("check-vehicle hummingbirt", 'unknown vehicle "hummingbirt" (did you mean "hummingbird"?)'),
    ("check-vehicle x500 --workers 0", "workers: must be a whole number of at least 1, not 0"),
    ("check-controller lpv-mpc --duration 0", "argument --duration: must be above zero"),
    (f"companion --vehicle {LINK}", "name a TRACK to fly, or --identify"),
    (f"companion spirl --vehicle {LINK}", 'unknown track "spirl"'),
    (f"companion hover:height=-3 --vehicle {LINK}", "below the floor"),
    (f"companion spiral --arm --dry-run --vehicle {LINK}", "--dry-run does not arm"),
    (f"companion spiral --identify --vehicle {LINK}", "--identify hovers"),
    (f"companion spiral --response none.toml --vehicle {LINK}", "none.toml: No such file"),
    (f"companion none.plan --vehicle {LINK}", "none.plan: No such file"),
    (
        f"companion spiral --stack betaflight --vehicle {LINK}",
        'unknown value "betaflight" (choose px4, ardupilot, colibri)',
    ),
    ("companion hover --vehicle udpout:192.0.2.1:14540", "reaches beyond this computer"),
    ("companion hover --vehicle 14540", "expected"),
    ("companion hover --vehicle udpin:nowhere", "expected"),
    (
        "compare --profile fast --out out",
        'unknown profile "fast" (choose agile, flight, path, se3, thesis, thesis-euler, a .toml file)',
    ),
    (
        "compare --profile thesis:pid --out out",
        'unknown controller "pid" (choose cascade, geometric-se3, global-lpv-mpc, lpv-mpc)',
    ),
    ("compare --track loop --out out", 'unknown track "loop" (choose spiral'),
    ("compare --seeds=5-1", 'argument --seeds: must be FIRST-LAST, for example 1-50, not "5-1"'),
    ("compare --seeds=one", 'argument --seeds: must be FIRST-LAST, for example 1-50, not "one"'),
    ("compare --seeds=1-two", 'argument --seeds: must be FIRST-LAST, for example 1-50, not "1-two"'),
    ("compare --seeds=", 'argument --seeds: must be FIRST-LAST, for example 1-50, not ""'),
    ("compare --tracks hover", "unrecognized arguments: --tracks hover (see colibri compare --help)"),
    ("doctor --gcs nonsense", "nonsense"),
    ("figures --only 5.1 --out out", 'unknown figure "5.1" (choose 4.1 to 4.11 or A.1 to A.24)'),
    ("fly hover --fail-above=speed=3", ""),
    ("fly hover --fail-above=rmse_m=low", ""),
    ("fly hover --fail-above=", ""),
    ("fly hover --fail-above=nan", ""),
    ("fly spiral --view --link memory", "--view needs --link udp"),
    (
        "fly spiral --link memory --gcs udpin:127.0.0.1:0 --quiet --out out",
        "--gcs needs --link udp: over memory no autopilot",
    ),
    (
        "fly spiral --gcs udpin:0.0.0.0:0 --quiet --out out",
        "udpin:0.0.0.0:0 reaches beyond this computer: give --signing-key FILE",
    ),
    ("fly spiral --gcs radio:1 --quiet --out out", "radio:1: expected udpin:HOST:PORT or udpout:HOST:PORT"),
    ("plant --realtime --speed max", "--realtime follows the wall clock"),
    ("plant --realtime --serve px4", "--realtime follows the wall clock"),
    ("plant --link udpin:127.0.0.1:0 --without air", 'argument --without: unknown value "air" (choose '),
    ("replay nowhere.ulg", "cannot read nowhere.ulg: No such file or directory"),
    ("sitl --plant-port 0 --home 47,8", "argument --home: expected LAT,LON,ALT,YAW in degrees and metres, not 47,8"),
    (
        "sitl --plant-port 0 --home 0,181,0,0",
        "argument --home: not a latitude of -90 to 90 and a longitude of -180 to 180",
    ),
    ("sitl --plant-port 0 --identity betaflight", 'argument --identity: unknown value "betaflight" (choose '),
    ("sitl --plant-port 0 --profile fast", 'unknown profile "fast" (choose agile, flight'),
    ("sitl --plant-port 0 --vehicle dragonfly", 'unknown vehicle "dragonfly" (choose crazyflie'),
    ("sitl --plant-port 0 --plant-vehicle dragonfly", 'unknown vehicle "dragonfly" (choose crazyflie'),
    ("sitl --plant-port 0 --profile thesis", "vehicle hummingbird-thesis has no ground to stand on"),
    (
        "sitl --plant-port 0 --profile thesis --feedback sensors",
        "--feedback sensors: vehicle AscTec Hummingbird (thesis) has",
    ),
    ("sitl --plant-port 0 --gcs 14550", "14550: expected udpin:HOST:PORT or udpout:HOST:PORT or tcpin:HOST:PORT"),
    (
        "sitl --plant-port 0 --gcs udpin:0.0.0.0:14550",
        "udpin:0.0.0.0:14550 reaches beyond this computer: give --signing-key FILE, or --insecure",
    ),
    (
        "sitl --plant-port 0 --gcs udpout:192.0.2.1:14550",
        "udpout:192.0.2.1:14550 reaches beyond this computer: give --signing-key FILE, or --insecure",
    ),
    ("sitl --plant-port 0 --count 2 --gcs udpin:127.0.0.1:16210", "--gcs: several vehicles cannot have one port"),
    ("sitl --plant-port 0 --count 2 --gcs tcpin:127.0.0.1:16210", "--gcs: several vehicles cannot have one port"),
    ("sitl --plant-port 0 --count 2 --gcs serial:/dev/ttyACM0:57600", "--gcs: several vehicles cannot have one port"),
    ("sitl --plant-port 0 --count 0", "--instance and --count: at least one vehicle, instances from 0 to 99"),
    ("sitl --plant-port 0 --instance 100", "--instance and --count: at least one vehicle, instances from 0 to 99"),
    ("sitl --plant-port 0 --instance -1", "argument --instance: must be a whole number of at least 0, not -1"),
    ("sitl --plant-port 0 --speed 0", "argument --speed: must be a number above 0, or max, not 0"),
    ("show profile nobody", 'unknown profile "nobody" (choose '),
    ("show vehicle nobody", 'unknown vehicle "nobody" (choose '),
    ("study speed flips --out out", 'unknown study "flips" (choose '),
    ("tune none.toml --out out", "none.toml: No such file or directory"),
    ("verify --golden --only leap", '--only: unknown golden flight "leap"'),
    ("verify --golden --duration 5", "--duration cannot be combined with --golden"),
    ("verify --renew", "--renew goes with --golden alone"),
    ("verify --only spiral", "--only goes with --golden alone"),
    ("vehicle dragonfly --for px4 --out out", 'unknown vehicle "dragonfly" (choose '),
    ("vehicle iris --for px4 --out .", "cannot write .: Is a directory"),
    ("view nowhere --no-browser", "not a flight folder"),
    ("view udpin:127.0.0.1:0 out/spiral --no-browser", "one link, or folders of flights"),
    ("view udpin:127.0.0.1 --no-browser", "expected"),
    ("view udpin:127.0.0.1:0 --export x.html --no-browser", "give their folders"),
    ("view out --port 70000 --no-browser", "from 0 to 65535"),
]


@pytest.mark.parametrize(("command", "message"), MESSAGES, ids=[command for command, _ in MESSAGES])
def test_a_refusal_is_one_line(
    command: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in refused(*shlex.split(command))
    assert command.startswith(("certify", "compare")) or not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", ["view", "plot"])
def test_a_file_in_place_of_a_flight_is_refused(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("flight.tlog").touch()
    assert refused(command, "flight.tlog").startswith('"flight.tlog" is a file: expected the folder of a flight')


def test_help_of_every_link_names_serial_ports() -> None:
    links: dict[str, str] = {}
    for name in COMMANDS:
        parser = ArgumentParser()
        add_options(name, parser)
        options = re.split(r"\n  (?=\S)", parser.format_help())
        one_line = [" ".join(option.split()) for option in options]
        links |= {f"{name} {option.split()[0]}": option for option in one_line if "tcp: or tcpin:" in option}
    assert len(links) >= 5
    assert [name for name, words in links.items() if "serial:" not in words] == []


def test_no_error_is_empty() -> None:
    assert str(Error()) == "Error"
    assert str(InFlightError("lost")) == "lost"
