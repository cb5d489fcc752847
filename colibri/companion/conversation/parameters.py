"""Parameters of a vehicle, read one by one; what nobody answers, the vehicle has not.

https://mavlink.io/en/services/parameter.html
"""

from collections.abc import Iterable

from colibri.mavlink.parameters.store import Kind, value_of
from colibri.mavlink.wire.dialect import Message, param_bits

AGAIN_US = 500_000
TRIES = 4
_AT_ONCE = 3


class ParameterReader:
    """Reads parameters.

    Attributes:
        values: Of those that the vehicle has.
    """

    def __init__(self, names: Iterable[str], *, integers_by_bits: bool) -> None:
        """Read `names`; integers travel bytewise or as numbers."""
        self._names = tuple(dict.fromkeys(names))
        self._by_bits = integers_by_bits
        self._tries = dict.fromkeys(self._names, 0)
        self._again_us = dict.fromkeys(self._names, 0)
        self.values: dict[str, float] = {}
        self._absent: set[str] = set()

    @property
    def done(self) -> bool:
        """Whether each was read, or is known not to be."""
        return all(name in self.values or name in self._absent for name in self._names)

    def poll(self, now_us: int) -> list[str]:
        """Return the names to request now."""
        wanted = [name for name in self._names if name not in self.values and name not in self._absent]
        due = []
        for name in wanted[:_AT_ONCE]:
            if now_us < self._again_us[name]:
                continue
            if self._tries[name] >= TRIES:
                self._absent.add(name)
                continue
            self._tries[name] += 1
            self._again_us[name] = now_us + AGAIN_US
            due.append(name)
        return due

    def receive(self, message: Message) -> None:
        """Take in a PARAM_VALUE or a PARAM_ERROR."""
        name = message.fields.param_id
        if name not in self._tries:
            return
        if message.name == "PARAM_ERROR":
            self._absent.add(name)
        elif self._by_bits and message.fields.param_type == Kind.INT:
            self.values[name] = float(value_of(Kind.INT, param_bits(message)))
        else:
            self.values[name] = float(message.fields.param_value)
