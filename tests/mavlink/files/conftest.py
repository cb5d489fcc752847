"""FTP over files in memory; other modules here have a `memory` of their own."""

import pytest

from colibri.mavlink.files.ftp import Ftp
from colibri.mavlink.files.memory import MemoryFiles
from colibri.mavlink.files.tree import Tree
from tests.support.ftp_client import TEXT, Client


@pytest.fixture
def memory() -> MemoryFiles:
    memory = MemoryFiles()
    memory.create(("text",))
    memory.write(("text",), 0, TEXT)
    return memory


@pytest.fixture
def service(memory: MemoryFiles) -> Ftp:
    return Ftp(Tree(memory, {"logs": MemoryFiles()}, {"@PARAM/param.pck": lambda query: b"Q" + query.encode()}))


@pytest.fixture
def client(service: Ftp) -> Client:
    return Client(service)
