"""`replay completion`: a shell that reads the script completes commands, flags, values and files."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from replay.commands import COMMANDS
from tests.program import Program

_COMPLETE = """
source {script}
function=$(complete -p replay | sed 's/.*-F \\([^ ]*\\).*/\\1/')
COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); COMPREPLY=()
$function replay "${{COMP_WORDS[COMP_CWORD]}}" "${{COMP_WORDS[COMP_CWORD - 1]}}"
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.fixture
def folder(replay: Program, tmp_path: Path) -> Path:
    (tmp_path / "replay.bash").write_text(replay("completion", "bash").out, encoding="utf-8")
    for name in ("run.mcap", "run.toml"):
        (tmp_path / name).touch()
    (tmp_path / "bravo").mkdir()
    return tmp_path


def completed(folder: Path, *words: str) -> list[str]:
    quoted = " ".join(f"'{word}'" for word in words)
    script = _COMPLETE.format(script="replay.bash", words=quoted)
    ran = subprocess.run(["bash", "-c", script], cwd=folder, capture_output=True, text=True, timeout=30)
    assert ran.returncode == 0, ran.stderr
    assert ran.stderr == ""
    return sorted(ran.stdout.split())


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash here to try the script in")
class TestBash:
    @pytest.mark.parametrize(
        ("words", "expected"),
        [
            (("replay", "mer"), ["merge"]),
            (("replay", ""), sorted(COMMANDS)),
            (("replay", "--ver"), ["--version"]),
            (("replay", "merge", "--rob"), ["--robots"]),
            (("replay", "merge", "run.mcap", "--clock", ""), ["header", "log"]),
            (("replay", "merge", "run.mcap", "--images", "c"), ["changed"]),
            (("replay", "merge", "ru"), ["run.mcap", "run.toml"]),
            (("replay", "merge", "br"), ["bravo"]),
            (("replay", "info", "run.m"), ["run.mcap"]),
            (("replay", "recover", "run.m"), ["run.mcap"]),
            (("replay", "merge", "--config", "run.t"), ["run.toml"]),
            (("replay", "completion", "z"), ["zsh"]),
        ],
    )
    def test_completes(self, folder: Path, words: tuple[str, ...], expected: list[str]) -> None:
        assert completed(folder, *words) == expected


@pytest.mark.parametrize(
    ("shell", "check"), [("bash", ("bash", "-n")), ("zsh", ("zsh", "-n")), ("fish", ("fish", "--no-execute"))]
)
def test_each_script_is_one(replay: Program, tmp_path: Path, shell: str, check: tuple[str, ...]) -> None:
    script = tmp_path / "script"
    script.write_text(replay("completion", shell).out, encoding="utf-8")
    text = script.read_text(encoding="utf-8")
    assert all(f"{name}" in text for name in COMMANDS)
    assert "require-all" in text
    if shutil.which(shell) is None:
        pytest.skip(f"there is no {shell} here to check the script with")
    ran = subprocess.run([*check, script], capture_output=True, text=True, timeout=30)
    assert (ran.returncode, ran.stderr) == (0, "")


def test_another_shell_is_refused(replay: Program) -> None:
    assert "'bsh' is none of bash, zsh, fish, tcsh; did you mean bash?" in replay("completion", "bsh").error
