"""A control law as the offboard companion of a vehicle."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.companion.guide import Companion as Companion
    from colibri.companion.settings import CompanionSettings as CompanionSettings
    from colibri.companion.stack import CompanionError as CompanionError
else:
    __getattr__, __dir__ = public(__name__)
