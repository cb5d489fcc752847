"""The picture of a payload: flown with the mass learned and not."""

import pytest

from tools.pages.payload import PAYLOAD_KG, draw, fly

SECONDS = (0.5, 2.5, 3.5)


def test_a_payload_is_felt_at_once_and_told_where_it_is_learned() -> None:
    flown = {
        label: fly(None, learns=label == "mass learned", seconds=SECONDS)
        for label in ("mass learned", "mass not learned")
    }
    for laden in flown.values():
        assert -0.015 < laden.height_error_m.min() < -0.005
        assert 0.004 < laden.height_error_m[laden.t > SECONDS[1]].max() < 0.015
    learned, kept = (laden.told[:, 1] for laden in flown.values())
    assert kept.max() == kept.min() == pytest.approx(learned[0], rel=1e-5)
    assert 0.2 * PAYLOAD_KG < learned.max() - learned[0] < PAYLOAD_KG
    assert len(draw({"hover": flown, "lemniscate": flown}).axes) == 3
