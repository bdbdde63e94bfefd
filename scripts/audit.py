"""Ask for known vulnerabilities of the packages that requirements/*.txt pin. It needs the network.

    make audit                   0: none known; 1: some are; 3: it could not be asked, of all packages or of some
    make audit OFFLINE_OK=1      the same, but 0 instead of 3, and says so

pip-audit's own exit status does not serve: it also reports success where no package could be looked up.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
LOCKS = ("dev.txt", "docs.txt", "tools.txt")  # run.txt is a part of dev.txt
NONE_KNOWN, SOME_KNOWN, NOT_AUDITED = 0, 1, 3


@dataclass(frozen=True, slots=True)
class Audit:
    """What was found out of the packages of one lock.

    Parameters
    ----------
    asked
        How many packages were looked up.
    skipped
        Names of those that could not be.
    vulnerable
        One line for each known vulnerability.
    failure
        Why nothing could be asked at all; "" if it could.
    """

    asked: int = 0
    skipped: tuple[str, ...] = ()
    vulnerable: tuple[str, ...] = ()
    failure: str = ""

    @property
    def is_whole(self) -> bool:
        """Tell whether every package was looked up."""
        return not self.failure and not self.skipped and self.asked > 0

    @property
    def summary(self) -> str:
        """Say in a line how far the audit got."""
        if self.failure:
            return f"NOT AUDITED, no answer: {self.failure}"
        if self.is_whole:
            return f"{self.asked} packages, {len(self.vulnerable)} known vulnerabilities"
        names = ", ".join(self.skipped[:5]) + ", …" * (len(self.skipped) > 5)
        return f"NOT AUDITED, {len(self.skipped)} packages could not be looked up, as without a network: {names}"


def understood(answer: dict[str, Any]) -> Audit:
    """Return what pip-audit's answer says."""
    packages = answer.get("dependencies", [])
    return Audit(
        asked=sum("skip_reason" not in each for each in packages),
        skipped=tuple(each["name"] for each in packages if "skip_reason" in each),
        vulnerable=tuple(
            f"{each['name']} {each['version']}: {found['id']}; fixed in {', '.join(found['fix_versions']) or 'none'}"
            for each in packages
            for found in each.get("vulns", [])
        ),
    )


def status(audits: list[Audit]) -> int:
    """Return what the program ends with."""
    if any(each.vulnerable for each in audits):
        return SOME_KNOWN
    return NONE_KNOWN if all(each.is_whole for each in audits) else NOT_AUDITED


def audited(lock: Path) -> Audit:
    """Ask for the packages of one lock."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        options = ("--require-hashes", "--disable-pip", "--progress-spinner", "off", "--timeout", "10")
        command = [sys.executable, "-m", "pip_audit", "-r", str(lock), *options, "-f", "json", "-o", str(answer)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if answer.exists():
            return understood(json.loads(answer.read_text(encoding="utf-8")))
    return Audit(failure=(done.stderr.strip().splitlines() or ["it said nothing"])[-1][:300])


def main() -> int:
    """Audit the locks and say what was found."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--offline-ok", action="store_true", help="end with 0 if nothing could be asked")
    offline_ok = parser.parse_args().offline_ok
    audits = [audited(ROOT / "requirements" / name) for name in LOCKS]
    for name, audit in zip(LOCKS, audits, strict=True):
        for line in (*audit.vulnerable, audit.summary):
            print(f"{name}: {line}")
    found = status(audits)
    return NONE_KNOWN if found == NOT_AUDITED and offline_ok else found


if __name__ == "__main__":
    sys.exit(main())
