"""The folder of --state: parameters, key, files, logs, plans, flight."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.core.checkpoint import Checkpoint, History
from colibri.autopilot.errors import AutopilotError
from colibri.autopilot.identities import conventions_of
from colibri.autopilot.parameters.definitions import definitions
from colibri.autopilot.spec import AutopilotSpec
from colibri.common.errors import unknown
from colibri.common.files import private, read_bytes, read_text, regular
from colibri.common.process.folder_lock import FolderLock
from colibri.common.process.slot_file import Slots
from colibri.common.serialization import of_bytes, to_bytes
from colibri.mavlink.files.folder import Folder
from colibri.mavlink.files.tree import Quota
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.parameters.file import ParameterFileError, read, write
from colibri.mavlink.parameters.store import Parameters, Value
from colibri.mavlink.wire.signing import Signing, SigningError, read_key
from colibri.plant.vehicle.description import Vehicle

KEY = "signing.key"
TIMESTAMP = "signing.timestamp"
FILES = "files"
LOGS = "logs"
FLIGHT = "flight"
PLANS = "plans"
LOG_QUOTA = Quota(512 << 20, 200)


class GroundError(AutopilotError):
    """Ground stations cannot be served; the message is for the user."""


class StateFolder:
    def __init__(self, spec: AutopilotSpec, profile: Profile, vehicle: Vehicle, clock: Callable[[], int]) -> None:
        """Open the folder, or raise FolderInUseError or GroundError; `clock` is the wall clock of signatures."""
        self._path = path = spec.state
        self._profile, self._vehicle = profile, vehicle
        self._system_id, self._params = spec.system_id, spec.params
        self._conventions = conventions_of(spec.identity)
        self.warnings: list[str] = []
        self.signing = Signing(self._read_key(spec.signing_key), clock, self._read_timestamp())
        try:
            self._lock = FolderLock(path, "--state") if path else None
            self.files = Folder(path / FILES) if path else None
            self.logs = Folder(path / LOGS, LOG_QUOTA) if path else None
            self._flight = Slots(path / FLIGHT) if path else None
        except OSError as error:
            raise GroundError(f"cannot write to --state {path}: {error.strerror}") from error

    @property
    def keeps_flights(self) -> bool:
        return self._flight is not None

    def history(self) -> History | None:
        content = self._flight.newest() if self._flight else None
        kept = of_bytes(Checkpoint, content) if content else None
        return None if kept is None else History(kept, self.plans())

    def keep(self, record: Checkpoint) -> bool:
        """Save the flight's state; return whether it fitted."""
        return self._flight is None or self._flight.write(to_bytes(record))

    def save_plans(self, plans: Mapping[int, Sequence[MissionItem]]) -> None:
        if self._path is not None:
            _replace(self._path / PLANS, to_bytes(dict(plans)))

    def parameter_path(self) -> Path:
        """Return the parameter file, one for each control law and vehicle."""
        assert self._path is not None, "called only where something is kept"
        name = f"{self._profile.controller}-{self._vehicle.name.lower().replace(' ', '-')}"
        return self._path / f"{name}{self._conventions.folder_suffix}.params"

    def _parameters(self) -> Parameters:
        ours = definitions(self._profile, self._vehicle, self._system_id)
        return self._conventions.parameters(ours, self._system_id)

    def parameters(self) -> dict[str, Value]:
        """Return the saved parameters, or raise GroundError."""
        if self._path is None:
            return self._initial()
        path = self.parameter_path()
        if not path.exists() and self._profile.controller == "lpv-mpc":
            path = path.with_name(f"whole-{path.name}")  # as 0.1 named it
        try:
            text = read_text(path).replace("\tWHL_", "\tLPV_")
        except FileNotFoundError:
            return self._initial()
        except (OSError, UnicodeDecodeError) as error:
            raise GroundError(f"cannot read parameters from {path}: {error}") from error
        try:
            return read(text, self._parameters())
        except ParameterFileError as error:
            raise GroundError(f"{path}: {error}; correct or remove it") from error

    def _initial(self) -> dict[str, Value]:
        parameters = self._parameters()
        for name, value in self._params.items():
            if name not in parameters:
                raise GroundError(unknown("parameter", name, (each.name for each in parameters)))
            refusal = parameters.set(name, value)
            if refusal is not None:
                raise GroundError(f"parameter {name} cannot be {value:g}: {refusal.name}")
        return {each.name: parameters[each.name] for each in parameters if parameters[each.name] != each.default}

    def save_parameters(self, parameters: Parameters) -> None:
        if self._path is not None:
            _replace(self.parameter_path(), write(parameters, self._system_id).encode())

    def save_signing(self) -> None:
        if self._path is None or not (self.signing.active or self.signing.key_changed):
            return
        _replace(self._path / TIMESTAMP, str(self.signing.timestamp).encode())
        if self.signing.key_changed:
            self.signing.key_changed = False
            key = self.signing.key
            if key is None:
                (self._path / KEY).unlink(missing_ok=True)
            else:
                _replace(self._path / KEY, key, private)

    def close(self) -> None:
        for kept in (self.files, self.logs, self._flight, self._lock):
            if kept:
                kept.close()

    def plans(self) -> dict[int, list[MissionItem]]:
        if self._path is None:
            return {}
        try:
            content = read_bytes(self._path / PLANS)
        except OSError:
            return {}
        return of_bytes(dict[int, list[MissionItem]], content) or {}

    def _read_key(self, path: Path | None) -> bytes | None:
        if path is None and self._path and (self._path / KEY).exists():
            path = self._path / KEY
        try:
            if path is None:
                return None
            key, warning = read_key(path)
        except OSError as error:
            raise GroundError(f"cannot read signing key {path}: {error.strerror}") from error
        except SigningError as error:
            raise GroundError(f"signing key {path}: {error}") from error
        if warning:
            self.warnings.append(f"signing key {path}: {warning}")
        return key

    def _read_timestamp(self) -> int:
        if self._path is None:
            return 0
        path = self._path / TIMESTAMP
        try:
            return int(read_text(path))
        except (FileNotFoundError, NotADirectoryError):
            return 0
        except OSError as error:
            raise GroundError(f"cannot read {path}: {error.strerror}") from error
        except ValueError as error:
            raise GroundError(f"{path}: not a whole number; remove it once the clock is right") from error


def _replace(path: Path, content: bytes, opener: Callable[[str, int], int] = regular) -> None:
    new = path.with_suffix(path.suffix + ".new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if opener is private:
            new.unlink(missing_ok=True)  # whoever has it open would read the key
        with open(new, "wb", opener=opener) as file:
            file.write(content)
        new.replace(path)
    except OSError:
        return
