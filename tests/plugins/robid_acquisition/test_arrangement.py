"""Any set of recordings becomes a dense array of whole blocks in the order of their numbers; what is lost is told."""

from __future__ import annotations

from hypothesis import given, strategies as st

from robid_acquisition.arrangement import arrange
from robid_acquisition.recording import Recording

places = st.tuples(st.sampled_from(["", "light"]), st.integers(0, 4), st.integers(1, 3), st.integers(1, 3))


def recordings(found: set[tuple[str, int, int, int]]) -> list[Recording]:
    return [Recording(f"{v}{c}{b}{e}.npz", c, b, e, variant=v) for v, c, b, e in found]


@given(st.sets(places, min_size=1))
def test_every_arrangement_is_dense_in_order_and_tells_what_it_left_out(
    found: set[tuple[str, int, int, int]],
) -> None:
    given_recordings = recordings(found)
    arrangement = arrange(given_recordings)
    n_config, n_block, n_exp = arrangement.shape
    kept = [one for blocks in arrangement.recordings for block in blocks for one in block]
    assert len(kept) == len(set(kept_places(kept))) == n_config * n_block * n_exp
    assert kept_places(kept) == sorted(kept_places(kept))
    assert {len(block) for blocks in arrangement.recordings for block in blocks} == {n_exp}
    assert (
        len({tuple(one.experiment for one in block) for blocks in arrangement.recordings for block in blocks})
        == 1
    )
    for blocks, variant in zip(arrangement.recordings, arrangement.variants, strict=True):
        assert {(one.variant, one.configuration) for block in blocks for one in block} == {
            (variant, blocks[0][0].configuration)
        }
    if len(kept) < len(given_recordings):
        assert arrangement.shortfalls


def kept_places(kept: list[Recording]) -> list[tuple[str, int, int, int]]:
    return [(one.variant, one.configuration, one.block, one.experiment) for one in kept]


@given(st.sets(places, min_size=1), st.randoms())
def test_the_order_in_which_files_are_found_plays_no_part(
    found: set[tuple[str, int, int, int]], chance: object
) -> None:
    given_recordings = recordings(found)
    shuffled = list(given_recordings)
    chance.shuffle(shuffled)  # type: ignore[attr-defined]
    assert arrange(shuffled).recordings == arrange(given_recordings).recordings


def test_a_whole_grid_is_kept_without_a_word() -> None:
    grid = {("", c, b, e) for c in range(16) for b in range(2) for e in range(6)}
    arrangement = arrange(recordings(grid))
    assert arrangement.shape == (16, 2, 6)
    assert arrangement.shortfalls == ()
