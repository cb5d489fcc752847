"""`colibri`: the command. Loads only modules of the subcommand."""

import os
import sys
import threading
import warnings
from collections.abc import Sequence
from errno import EDQUOT, EFBIG, ENOSPC
from importlib import import_module

from colibri.cli.commands import COMMANDS, PROCESSES, parser_for
from colibri.common.errors import Error
from colibri.common.process import lifecycle
from colibri.common.process.output import use_streams
from colibri.common.process.writable_folders import use_writable_folders

_NO_ROOM = (ENOSPC, EDQUOT, EFBIG)


def main(argv: list[str] | None = None) -> int:
    given = sys.argv[1:] if argv is None else argv
    use_streams()
    warnings.formatwarning = lambda message, *_args: f"colibri: {message}\n"
    _check_encoding(given)
    if given and given[0] in PROCESSES:
        with lifecycle.one_line(lifecycle.EXIT_FAILED):
            process_code: int = import_module(f"colibri.{given[0]}.__main__").main(given[1:])
            return process_code
    lifecycle.use_one_thread()
    os.environ["PYTHONSAFEPATH"] = "1"  # modules of child processes are not from the working directory
    os.environ["MPLBACKEND"] = "agg"  # figures are files
    lifecycle.end_quickly()
    if threading.current_thread() is threading.main_thread():
        lifecycle.handle_endings(lifecycle.interrupt)  # so that what was started is ended, too
    try:
        with lifecycle.loading():
            args, unknown = parser_for(given).parse_known_args(given)
        if unknown:
            lifecycle.fail(f"unrecognized arguments: {' '.join(unknown)} (see colibri {args.command} --help)")
        if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
            lifecycle.fail("NUMBA_DISABLE_JIT must be unset: kernels are compiled")
        use_writable_folders()
        with lifecycle.loading():
            run = COMMANDS[args.command].load()
        code = run(args)
        sys.stdout.flush()
        return code
    except Error as error:
        lifecycle.fail(str(error), lifecycle.EXIT_FAILED)
    except BrokenPipeError:  # nobody reads any more: `colibri show ... | head`
        _drop_what_cannot_be_printed()
        return lifecycle.EXIT_FAILED
    except OSError as error:
        if error.errno not in _NO_ROOM:
            if error.filename is None:
                raise
            lifecycle.fail(f"{error.filename}: {error.strerror}", lifecycle.EXIT_FAILED)
        _drop_what_cannot_be_printed()
        lifecycle.fail(f"cannot write {error.filename or 'to disk'}: {error.strerror}", lifecycle.EXIT_FAILED)
    except KeyboardInterrupt as ended:
        lifecycle.fail_interrupted(ended)


def _drop_what_cannot_be_printed() -> None:
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _check_encoding(given: Sequence[str]) -> None:
    for word in given:
        try:
            word.encode()
        except UnicodeEncodeError:
            lifecycle.fail(f"{word} is not UTF-8 by this locale: rename the file, or try LC_ALL=C.UTF-8")
