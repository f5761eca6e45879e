"""Typical roads of named kinds, and of shares."""

import pytest

from tripwatt.roads.journey.kinds import KINDS, road_prior, shares_over, typical_road


@pytest.mark.parametrize("kind", [*KINDS])
def test_a_named_kind_has_a_town_of_its_length_and_given_shares_are_kept(kind):
    """A city has no other roads, so both are the same there."""
    long_m = 150_000.0
    named, given = typical_road(long_m, kind), typical_road(long_m, KINDS[kind])
    prior = road_prior()
    assert named.duration_s == prior.plan(long_m, shares_over(KINDS[kind], long_m)).duration_s
    assert given.duration_s == prior.plan(long_m, KINDS[kind]).duration_s
    assert (named.duration_s == given.duration_s) == (KINDS[kind][0] in (0.0, 1.0))
