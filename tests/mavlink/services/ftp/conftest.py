"""A service with one file, and a client of it."""

import pytest

from mavlink.files import ReadOnly, Tree
from mavlink.memory import Memory
from mavlink.services.ftp import Ftp
from tests.mavlink.services.ftp.client import Client

TEXT = bytes(range(256)) * 20


@pytest.fixture
def memory() -> Memory:
    memory = Memory()
    memory.create(("text",))
    memory.write(("text",), 0, TEXT)
    return memory


@pytest.fixture
def service(memory: Memory) -> Ftp:
    return Ftp(Tree(memory, {"logs": ReadOnly(Memory())}, {"@PARAM/param.pck": lambda query: b"Q" + query.encode()}))


@pytest.fixture
def client(service: Ftp) -> Client:
    return Client(service)
