"""Laws of stamps: clocks that are off, drift, run at another rate or jump are followed; single errors are not."""

from hypothesis import given
from hypothesis import strategies as st

from replay.stamps import Stamp, StampCheck, lead_at_start_ns

SECOND = 10**9
HOUR = 3_600 * SECOND
YEAR = 365 * 24 * HOUR
START = 50 * YEAR

gaps_s = st.lists(st.floats(0.01, 300.0), min_size=3, max_size=30)
leads_ns = st.integers(-49 * YEAR, 40 * YEAR)
far_ns = st.one_of(st.integers(2 * HOUR, 30 * YEAR), st.integers(-30 * YEAR, -2 * HOUR))


def times(gaps_s):
    log_ns, found = START, []
    for gap_s in gaps_s:
        found.append(log_ns)
        log_ns += round(gap_s * SECOND)
    return found


@given(gaps_s, leads_ns, st.floats(0.0, 9.0), st.data())
def test_a_clock_that_is_off_and_runs_at_another_rate_is_believed(gaps_s, lead_ns, rate, data):
    check = StampCheck(lead_ns)
    for log_ns in times(gaps_s):
        jitter_ns = data.draw(st.integers(-5 * SECOND, 5 * SECOND))
        own_ns = START + lead_ns + round((log_ns - START) * rate) + jitter_ns
        # a map of a simulation may be as old as the gap before it
        assert check.believes(Stamp(own_ns, log_ns)) or rate > 5.0


@given(gaps_s, leads_ns, far_ns, st.data())
def test_one_that_is_far_off_is_not_believed_and_all_others_are(gaps_s, lead_ns, off_ns, data):
    check, wild = StampCheck(lead_ns), data.draw(st.integers(0, len(gaps_s) - 1))
    believed = [
        check.believes(Stamp(log_ns + lead_ns + (off_ns if index == wild else 0), log_ns))
        for index, log_ns in enumerate(times(gaps_s))
    ]
    assert believed == [index != wild for index in range(len(gaps_s))]


@given(gaps_s, leads_ns, far_ns)
def test_a_jump_that_stays_is_followed_after_two_messages(gaps_s, lead_ns, jump_ns):
    check = StampCheck(lead_ns)
    for log_ns in times(gaps_s):
        assert check.believes(Stamp(log_ns + lead_ns, log_ns))
    later = [check.believes(Stamp(log_ns + lead_ns + jump_ns, log_ns)) for log_ns in times([1.0, 1.0, 1.0, 1.0, 1.0])]
    assert later == [False, False, True, True, True]


@given(leads_ns, far_ns, st.integers(0, 2))
def test_one_of_the_first_three_does_not_decide_where_a_topic_begins(lead_ns, off_ns, wild):
    stamps = [
        Stamp(START + 10 * SECOND * index + lead_ns + (off_ns if index == wild else 0), START + 10 * SECOND * index)
        for index in range(3)
    ]
    assert lead_at_start_ns(stamps) == lead_ns
