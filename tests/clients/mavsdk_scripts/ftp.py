"""Files: there and back, listed, renamed, compared, removed."""

import sys
from pathlib import Path
from random import Random

from mavsdk.plugins.ftp import Ftp, FtpResult

from tests.clients.mavsdk_scripts.connection import connected, refused, streamed

SIZE = 20_000


def main(url: str) -> None:
    here = Path("exchanged.bin")
    here.write_bytes(Random(1).randbytes(SIZE))
    with connected(url) as vehicle:
        ftp = Ftp(vehicle)
        ftp.create_directory("/notes")
        streamed(lambda report: ftp.upload_async(str(here), "/notes", report), FtpResult.NEXT)
        assert ftp.are_files_identical(str(here), "/notes/exchanged.bin")
        ftp.rename("/notes/exchanged.bin", "/notes/kept.bin")
        assert [entry.name for entry in ftp.list_directory("/notes").entries] == ["kept.bin"]
        for burst in (True, False):
            Path("back").mkdir(exist_ok=True)
            streamed(lambda report: ftp.download_async("/notes/kept.bin", "back", burst, report), FtpResult.NEXT)  # noqa: B023
            assert Path("back/kept.bin").read_bytes() == here.read_bytes()
            Path("back/kept.bin").unlink()
        ftp.remove_file("/notes/kept.bin")
        ftp.remove_directory("/notes")
        refused(lambda: ftp.list_directory("/notes"), FtpResult.FILE_DOES_NOT_EXIST)


if __name__ == "__main__":
    main(sys.argv[1])
