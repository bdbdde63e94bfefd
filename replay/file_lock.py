"""Locks on open files that end with the process that holds them, however it ends."""

from __future__ import annotations

import errno
import os
import sys

# Some file systems of a network have no locks; there, two runs into one output are not told from one.
_NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL}

if sys.platform == "win32":
    import msvcrt

    # A lock keeps others from those bytes, so it is on one that no file has.
    _LOCKED_BYTE = 1 << 40

    def try_lock(descriptor: int, *, shared: bool = False) -> bool:
        """Lock an open file until it is closed; tell whether nobody else has it locked."""
        del shared
        at = os.lseek(descriptor, 0, os.SEEK_CUR)
        os.lseek(descriptor, _LOCKED_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        finally:
            os.lseek(descriptor, at, os.SEEK_SET)
        return True

else:
    import fcntl

    def try_lock(descriptor: int, *, shared: bool = False) -> bool:
        """Lock an open file until it is closed; tell whether nobody else has it locked."""
        try:
            fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise
        return True
