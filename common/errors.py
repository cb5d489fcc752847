"""The base of all errors shown to users, and the words of their messages."""

from collections.abc import Iterable


class Error(Exception):
    """A user's error; the message names input, value and remedy in one line."""

    def __str__(self) -> str:
        """Return the message, or the name of the class: no line is empty."""
        return super().__str__() or type(self).__name__


class ForeignError(Error):
    """An exception of another package's code, `__cause__`, shown with its traceback."""


class InFlightError(Error):
    """The flight ended early; its logs are kept."""


def unknown(what: str, given: object, known: Iterable[str]) -> str:
    """Return the message for an unknown name, with the closest or all valid names."""
    from difflib import get_close_matches

    names, text = [str(name) for name in known], shown(given)
    near = get_close_matches(text, names, 1)
    hint = f'did you mean "{near[0]}"?' if near else f"choose {', '.join(names)}"
    return f'unknown {what} "{text}" ({hint})'


def checked(what: str, given: object, kinds: type | tuple[type, ...], wanted: str, error: type[Error]) -> None:
    if not isinstance(given, kinds):
        raise error(f'{what} must be {wanted}, not {type(given).__name__} "{shown(given)}"')


def shown(given: object, most: int = 60) -> str:
    """Return a value for a message: control characters escaped, cut to `most` characters."""
    text = str(given)
    whole = text if len(text) <= most else f"{text[: most // 2]}…{text[-(most // 2) :]}"
    return "".join(
        letter if letter.isprintable() or letter == "\n" else letter.encode("unicode_escape").decode()
        for letter in whole
    )
