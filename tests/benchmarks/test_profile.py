"""What a flame graph says of a replay."""

import pytest

from benchmarks.profile import REST, Frame, frames, lines, main, part_of, sample, shares
from tests.data_paths import ROOT

RECORDING = ROOT / "samples" / "two_robots.mcap"


class TestShares:
    def test_the_innermost_known_function_has_the_sample(self):
        boxes = [
            Frame("all", 0, 0, 10),
            Frame("main (replay/cli.py:40)", 1, 0, 10),
            Frame("step (mapmerge/merger.py:100)", 2, 0, 6),
            Frame("fuse (mapmerge/fuse.py:40)", 3, 1, 4),
            Frame("at_resolution (mapmerge/resample.py:20)", 4, 1, 2),
            Frame("take (replay/sinks/mcap_file.py:80)", 2, 6, 3),
            Frame("iterencode (json/encoder.py:200)", 3, 8, 1),
        ]
        assert shares(boxes) == {"fusing": 0.4, "rest of the merger": 0.2, "writing": 0.2, "report": 0.1, REST: 0.1}

    def test_all_that_prepares_a_map_is_preparing(self):
        boxes = [
            Frame("match (mapmerge/match/correlation.py:60)", 0, 0, 4),
            Frame("CorrelationMatcher.prepare (mapmerge/match/correlation.py:50)", 1, 0, 3),
            Frame("orientation_spectra (mapmerge/match/spectrum.py:30)", 2, 0, 3),
        ]
        assert shares(boxes) == {"preparing maps": 0.75, "matching": 0.25}

    def test_helpers_work_for_their_callers(self):
        assert part_of("decode (replay/codec/decode.py:47)") == "decoding, putting in order"
        assert part_of("Tally.count (replay/feeds.py:61)") == "digests of the input"
        assert part_of("apply (mapmerge/sim2.py:70)") is None
        assert part_of("_count_dispatcher (numpy/lib/arraysetops.py:3)") is None

    def test_lines_are_percentages(self):
        assert lines({"matching": 0.613}) == ["matching                      61.3%"]


def test_a_replay_is_sampled(tmp_path, capsys):
    flame_graph = tmp_path / "flame.svg"
    try:
        main([str(RECORDING), "--output", str(flame_graph), "--no-rrd", "--images", "none"])
    except RuntimeError as error:
        if "ermission" in str(error):
            pytest.skip(f"processes may not be sampled here: {error}")
        raise
    parts = {line.rpartition(" ")[0].strip() for line in capsys.readouterr().out.splitlines()}
    assert "matching" in parts
    assert any("mapmerge/merger.py" in frame.name for frame in frames(flame_graph))


def test_a_replay_that_fails_is_said_to(tmp_path):
    with pytest.raises(RuntimeError):
        sample(tmp_path / "none.mcap", tmp_path / "flame.svg", [])
