"""A service with one file, and a client of it."""

import pytest

from colibri.mavlink.files.ftp import Ftp
from colibri.mavlink.files.memory import Memory
from colibri.mavlink.files.tree import Tree
from tests.support.ftp_client import TEXT, Client


@pytest.fixture
def memory() -> Memory:
    memory = Memory()
    memory.create(("text",))
    memory.write(("text",), 0, TEXT)
    return memory


@pytest.fixture
def service(memory: Memory) -> Ftp:
    return Ftp(Tree(memory, {"logs": Memory()}, {"@PARAM/param.pck": lambda query: b"Q" + query.encode()}))


@pytest.fixture
def client(service: Ftp) -> Client:
    return Client(service)
