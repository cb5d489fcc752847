from colibri.view.recorded.playback import SPEEDS, Playback, speed_of


def test_it_plays_pauses_and_goes_on() -> None:
    playing = Playback((0.0, 100.0)).play(50.0)
    assert playing.time_s(53.0) == 3.0
    paused = playing.pause(53.0)
    assert paused.time_s(90.0) == 3.0
    assert paused.play(90.0).time_s(91.0) == 4.0


def test_another_speed_goes_on_from_where_it_is() -> None:
    faster = Playback((0.0, 100.0)).play(0.0).at_speed(4.0, 10.0)
    assert faster.time_s(10.0) == 10.0
    assert faster.time_s(11.0) == 14.0


def test_it_stops_at_the_end_and_begins_again() -> None:
    over = Playback((2.0, 5.0)).play(0.0)
    assert over.time_s(99.0) == 5.0
    assert over.is_over(99.0)
    assert over.play(99.0).time_s(100.0) == 3.0


def test_a_jump_keeps_playing_or_standing() -> None:
    standing = Playback((0.0, 9.0)).seek(4.0, 1.0)
    assert standing.time_s(3.0) == 4.0
    assert standing.play(3.0).seek(6.0, 4.0).time_s(5.0) == 7.0


def test_speeds_are_numbers() -> None:
    assert [speed_of(text) for text in SPEEDS] == sorted(speed_of(text) for text in SPEEDS)
