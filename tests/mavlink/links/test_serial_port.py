"""Serial ports, on pseudo-terminals whose other end sends noise, comes late, and is pulled out."""

import os
import pty
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from colibri.mavlink.links.link import BlockingReceiver, LinkError
from colibri.mavlink.links.open import beyond_loopback, check_reach, open_ground_link
from colibri.mavlink.links.serial_port import MIN_QUEUE_BYTES, REOPEN_AFTER_S, SerialLink
from colibri.mavlink.wire.dialect import Codec
from colibri.mavlink.wire.framing import Framer
from tests.support.clock import Clock

BAUD = 57600
TIMEOUT_S = 5.0


def text(number: int) -> bytes:
    return Codec(255, 190).encode("STATUSTEXT", 6, b"%050d" % number, 0, 0)


def happened(link: SerialLink) -> list[object]:
    return [*link.receive_now(), *link.take_opened(), *link.take_closed(), *link.take_notes()]


class Device:
    """A pseudo-terminal under a name that stays: the device is whoever has its other end."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.plug_in()

    def plug_in(self) -> None:
        self._end, self._kept = pty.openpty()
        os.set_blocking(self._end, False)
        self.path.symlink_to(os.ttyname(self._kept))

    def pull_out(self) -> None:
        self.path.unlink()
        os.close(self._kept)
        os.close(self._end)

    def send(self, data: bytes) -> None:
        assert os.write(self._end, data) == len(data)

    def received(self) -> bytes:
        data = b""
        try:
            while chunk := os.read(self._end, 4096):
                data += chunk
        except BlockingIOError:
            pass
        return data


@pytest.fixture
def device(tmp_path: Path) -> Iterator[Device]:
    device = Device(tmp_path / "ttyACM0")
    yield device
    if device.path.is_symlink():
        device.pull_out()


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def link(device: Device, clock: Clock) -> Iterator[SerialLink]:
    with closing(SerialLink(f"serial:{device.path}:{BAUD}", str(device.path), BAUD, clock)) as link:
        assert link.take_opened() == [link.target]
        yield link


def heard(link: SerialLink, count: int) -> list[bytes]:
    frames: list[bytes] = []
    while len(frames) < count:
        link.wait(TIMEOUT_S)
        received = link.receive_now()
        assert received, f"{len(frames)} frames of {count}, and silence"
        assert {sender for _, sender in received} == {link.target}
        frames += [frame for frame, _ in received]
    return frames


def arrived(device: Device, count: int) -> list[bytes]:
    framer, frames = Framer(), list[bytes]()
    for _ in range(100_000):
        frames += framer.take(device.received())
        if len(frames) >= count:
            return frames
    raise AssertionError(f"{len(frames)} frames of {count}")


def lost(link: SerialLink) -> None:
    for _ in range(100_000):
        assert link.receive_now() == []
        if link.take_closed():
            return
    raise AssertionError("nothing noticed")


def test_frames_there_and_back(device: Device, link: SerialLink) -> None:
    assert link.receive_now() == []
    link.send(text(1))
    assert arrived(device, 1) == [text(1)]
    device.send(text(2))
    assert heard(link, 1) == [text(2)]
    link.send(text(3), ("another", 1))
    link.send(text(4), link.target)
    assert arrived(device, 1) == [text(4)]


def test_it_opens_by_url_and_counts_as_no_network(device: Device) -> None:
    url = f"serial:{device.path}:921600"
    assert not beyond_loopback(url)
    check_reach([url], signed=False, insecure=False)
    with closing(open_ground_link(url)) as link:
        assert (link.url, link.target) == (url, (str(device.path), 921600))
        device.send(text(1))
        received = BlockingReceiver(link).receive(TIMEOUT_S)
        assert received == (text(1), link.target)


def test_a_device_that_goes_and_comes_back_is_told_once_each(device: Device, link: SerialLink, clock: Clock) -> None:
    device.send(text(1)[:20])
    assert link.receive_now() == []
    device.pull_out()
    lost(link)
    (gone,) = link.take_notes()
    assert gone.startswith(f"{link.url}: the device is gone (")
    for _ in range(5):
        clock.now_s += REOPEN_AFTER_S
        link.send(text(2))
        assert happened(link) == []
    device.plug_in()
    assert happened(link) == [], "it is not looked for at every step"
    clock.now_s += REOPEN_AFTER_S
    assert link.receive_now() == []
    assert link.take_opened() == [link.target]
    assert link.take_notes() == [f"{link.url}: the device is back"]
    device.send(text(3))
    assert heard(link, 1) == [text(3)], "and not with the half frame of before"
    link.send(text(4))
    assert arrived(device, 1) == [text(4)], "and nothing of what was lost"


def test_a_device_that_goes_is_noticed_by_what_is_sent(device: Device, link: SerialLink) -> None:
    device.pull_out()
    for _ in range(100_000):
        link.send(text(1))
        if link.take_closed():
            break
    assert len(link.take_notes()) == 1
    link.wait(0.0)
    assert link.receive_now() == []


def test_a_blocked_line_drops_whole_frames(device: Device, link: SerialLink) -> None:
    sent = [text(number) for number in range(400)]
    for frame in sent:
        link.send(frame)
    framer = Framer()
    frames = framer.take(device.received())
    for _ in range(1000):
        link.receive_now()  # sends on what was waiting
        frames += framer.take(device.received())
    assert MIN_QUEUE_BYTES // len(sent[0]) < len(frames) < len(sent)
    assert frames == sent[: len(frames)]
    link.send(text(999))
    assert (frames + arrived(device, 1))[-1] == text(999)


def test_what_cannot_be_opened_is_said_with_what_to_do(
    device: Device, link: SerialLink, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = tmp_path / "plain"
    plain.touch()
    for path, what in (
        (tmp_path / "ttyACM9", "no such device: plug it in"),
        (device.path, "another program has it"),
        (plain, "not a serial port"),
    ):
        with pytest.raises(LinkError, match=f"^serial:{path}:{BAUD}: {what}"):
            open_ground_link(f"serial:{path}:{BAUD}")
    link.close()
    with pytest.raises(LinkError, match="unsupported baud rate"):
        open_ground_link(f"serial:{device.path}:999999999999999")
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(LinkError, match=r"pyserial is not installed: pip install colibri-sitl\[serial\]$"):
        open_ground_link(f"serial:{device.path}:{BAUD}")


@pytest.mark.parametrize("url", ["serial:", "serial:/dev/ttyACM0", "serial:/dev/ttyACM0:", "serial::57600",
                                 "serial:/dev/ttyACM0:0", "serial:/dev/ttyACM0:fast"])  # fmt: skip
def test_a_malformed_url_is_refused(url: str) -> None:
    for function in (open_ground_link, beyond_loopback):
        with pytest.raises(LinkError, match="expected serial:DEVICE:BAUD"):
            function(url)
