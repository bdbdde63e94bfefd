"""What is wrong with a file that does not begin as any recording does, where that can be told."""

from __future__ import annotations

from replay.words import counted

HEAD_BYTES = 4096
"""So much of a file is looked at to tell what it is."""

_BEGINNINGS = {
    b"\x89MCAP0\r\n": "an MCAP file",
    b"#ROSBAG V2.0\n": "a ROS 1 bag",
    b"SQLite format 3\0": "a .db3 file",
    b"\x28\xb5\x2f\xfd": "a file compressed with zstd",
}


def nothing_there(head: bytes) -> str:
    """Return that a file is empty, blank or cut off at once, and what to do; "" if it is something else.

    Parameters
    ----------
    head
        How it begins, `HEAD_BYTES` of it if there are as many.
    """
    if not head:
        return "the file is empty (0 bytes), as after a full disk: copy it again from where it was made"
    if not any(head):
        return (
            f"the file begins with {counted(len(head), 'byte')} that {'is' if len(head) == 1 else 'are all'} zero, as "
            "after a full disk or a power cut: copy it again from where it was made"
        )
    kind = next((kind for beginning, kind in _BEGINNINGS.items() if beginning.startswith(head)), None)
    if kind is None:
        return ""
    return (
        f"the file is cut off after {counted(len(head), 'byte')}, which are how {kind} begins: copy it again from "
        "where it was made"
    )
