"""What every sink that writes a file does, whatever it writes."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path

import pytest

from replay.errors import OutputError
from replay.events import Event
from replay.options import OutputOptions
from replay.pipeline import drain
from replay.sinks import SINKS, Sink, open_sinks, output_paths
from replay.sinks.partial_file import PartialFile
from tests.disks import files_up_to
from tests.scenarios import SCENARIOS, events_of

Opens = Callable[..., Sink]
TO_THE_BYTE = {"mcap", "json", "html"}


@pytest.fixture(params=SINKS)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def path(name: str, tmp_path: Path) -> Path:
    (tmp_path / "out").mkdir()
    return tmp_path / "out" / f"run.{name}"


@pytest.fixture
def open_sink(name: str, path: Path) -> Opens:
    return lambda **options: sink_class(name)(PartialFile.claimed(path), OutputOptions(path, **options))


def sink_class(name: str) -> Opens:
    module, _, attribute = SINKS[name].partition(":")
    return getattr(import_module(module), attribute)


def give(sink: Sink, events: Iterable[Event]) -> None:
    for event in events:
        sink.take(event)


def files(path: Path) -> list[str]:
    return sorted(each.name for each in path.parent.iterdir())


def test_output_paths_has_every_sink(tmp_path: Path) -> None:
    page = tmp_path / "elsewhere" / "page.html"
    beside = {name: tmp_path / f"a.b.{name}" for name in SINKS if name != "html"}
    assert output_paths(OutputOptions(tmp_path / "a.b.mcap", html=page)) == {**beside, "html": page}
    assert set(output_paths(OutputOptions(tmp_path / "a.mcap"))) == set(SINKS) - {"html"}
    assert set(output_paths(OutputOptions(tmp_path / "a.mcap", rrd=False, html=page))) == set(SINKS) - {"rrd"}


def test_where_the_json_report_is_all_are() -> None:
    assert list(SINKS)[-1] == "json"


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_takes_whatever_happens(open_sink: Opens, path: Path, scenario: str) -> None:
    sink = open_sink(copy_maps=True)
    give(sink, events_of(scenario))
    sink.finish()
    sink.publish()
    assert files(path) == [path.name]
    assert path.stat().st_size > 0


def test_nothing_has_its_final_name_before_it_is_published(open_sink: Opens, path: Path) -> None:
    sink = open_sink()
    for event in events_of("merged"):
        sink.take(event)
        assert not path.exists()
    sink.finish()
    assert files(path) == [f"{path.name}.partial"]
    sink.publish()
    assert files(path) == [path.name]


def test_what_was_there_stays_until_then(open_sink: Opens, path: Path) -> None:
    path.write_text("of an earlier run")
    sink = open_sink(force=True)
    give(sink, events_of("merged"))
    sink.finish()
    assert path.read_text() == "of an earlier run"
    sink.publish()
    assert b"of an earlier run" not in path.read_bytes()


@pytest.mark.parametrize("events", [0, 1, 3, None])
@pytest.mark.parametrize("finished", [False, True])
def test_discard_leaves_nothing(open_sink: Opens, path: Path, events: int | None, finished: bool) -> None:
    sink = open_sink()
    give(sink, events_of("merged")[:events])
    if finished:
        sink.finish()
    sink.discard()
    assert files(path) == []
    sink.discard()


def test_discard_leaves_what_was_published(open_sink: Opens, path: Path) -> None:
    sink = open_sink()
    give(sink, events_of("merged"))
    sink.finish()
    sink.publish()
    kept = path.read_bytes()
    sink.discard()
    assert path.read_bytes() == kept


@pytest.mark.parametrize("scenario", ["merged", "three_robots_one_unplaced", "no_map_at_all"])
def test_the_same_events_give_the_same_bytes(open_sink: Opens, name: str, path: Path, scenario: str) -> None:
    written = []
    for _ in range(2):
        sink = open_sink(copy_maps=True)
        give(sink, events_of(scenario))
        sink.finish()
        sink.publish()
        written.append(path.read_bytes())
    assert (written[0] == written[1]) or name not in TO_THE_BYTE


class TestErrors:
    """Whatever goes wrong is an `OutputError` of one line that names the file, and leaves nothing."""

    @staticmethod
    def run(open_sink: Opens, damage: Callable[[], object] = lambda: None) -> None:
        sink = open_sink()
        try:
            first, *rest = events_of("merged")
            sink.take(first)
            damage()
            give(sink, rest)
            sink.finish()
            sink.publish()
        except BaseException:
            sink.discard()
            raise

    def refused(self, path: Path, open_sink: Opens, damage: Callable[[], object] = lambda: None) -> str:
        with pytest.raises(OutputError) as caught:
            self.run(open_sink, damage)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
        assert not path.is_file()
        return str(caught.value)

    def test_no_folder(self, open_sink: Opens, path: Path) -> None:
        path.parent.rmdir()
        self.refused(path, open_sink)

    def test_the_folder_vanishes(self, open_sink: Opens, path: Path) -> None:
        said = self.refused(path, open_sink, lambda: shutil.rmtree(path.parent))
        assert "was removed or replaced while it was written" in said
        assert not path.parent.exists()

    def test_a_file_where_the_folder_should_be(self, open_sink: Opens, path: Path) -> None:
        path.parent.rmdir()
        path.parent.write_text("no folder")
        self.refused(path, open_sink)

    def test_a_folder_has_its_final_name(self, open_sink: Opens, path: Path) -> None:
        path.mkdir()
        self.refused(path, open_sink)
        assert files(path) == [path.name]

    def test_a_folder_has_its_temporary_name(self, open_sink: Opens, path: Path) -> None:
        path.with_name(f"{path.name}.partial").mkdir()
        self.refused(path, open_sink)

    def test_a_full_disk(self, open_sink: Opens, path: Path) -> None:
        with files_up_to(64):
            self.refused(path, open_sink)
        assert files(path) == []

    def test_a_name_that_is_too_long(self, name: str, path: Path) -> None:
        long = path.with_name(f"{'n' * 300}.{name}")
        with pytest.raises(OutputError, match="File name too long"):
            sink_class(name)(PartialFile.claimed(long), OutputOptions(long))


class TestTogether:
    @staticmethod
    def outputs(tmp_path: Path) -> OutputOptions:
        return OutputOptions(tmp_path / "run.mcap", html=tmp_path / "run.html")

    def test_all_are_published(self, tmp_path: Path) -> None:
        with open_sinks(self.outputs(tmp_path)) as sinks:
            drain(events_of("merged"), sinks)
            assert {each.suffix for each in tmp_path.iterdir()} == {".partial"}
        assert sorted(each.name for each in tmp_path.iterdir()) == sorted(f"run.{name}" for name in SINKS)

    @pytest.mark.parametrize("error", [KeyboardInterrupt, OutputError, ZeroDivisionError])
    def test_or_none(self, tmp_path: Path, error: type[BaseException]) -> None:
        def events() -> Iterable[Event]:
            yield from events_of("merged")[:4]
            raise error

        with pytest.raises(error), open_sinks(self.outputs(tmp_path)) as sinks:
            drain(events(), sinks)
        assert list(tmp_path.iterdir()) == []

    def test_none_if_one_cannot_be_opened(self, tmp_path: Path) -> None:
        in_the_way = tmp_path / "run.json.partial"
        in_the_way.symlink_to(tmp_path / "nowhere" / "at all")
        with pytest.raises(OutputError, match="is a link"), open_sinks(self.outputs(tmp_path)):
            pass
        assert list(tmp_path.iterdir()) == [in_the_way]

    def test_none_if_one_is_interrupted_while_it_is_opened(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        class Interrupted:
            def __init__(self, file: PartialFile, _options: OutputOptions) -> None:
                file.stream().close()
                raise KeyboardInterrupt

        monkeypatch.setattr("replay.sinks.json_file.JsonSink", Interrupted)
        with pytest.raises(KeyboardInterrupt), open_sinks(self.outputs(tmp_path)):
            pass
        assert list(tmp_path.iterdir()) == []

    def test_none_if_one_cannot_be_finished(self, tmp_path: Path) -> None:
        class Broken:
            def take(self, event: Event) -> None: ...
            def publish(self) -> None: ...
            def discard(self) -> None: ...
            def finish(self) -> None:
                raise OutputError("no")

        with pytest.raises(OutputError), open_sinks(self.outputs(tmp_path), extra=[Broken()]) as sinks:
            drain(events_of("merged"), sinks)
        assert list(tmp_path.iterdir()) == []
