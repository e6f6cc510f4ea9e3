"""Files that survive: atomic replacement, checksums, and a lock that dies with its process."""

import contextlib
import hashlib
import os
import platform
import uuid
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def named(what: str) -> Iterator[None]:
    """Begin the text of an OSError with what could not be done."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, f"{what}: {error.strerror or error}") from error


@contextlib.contextmanager
def writing(path: Path) -> Iterator[Path]:
    """Give a temporary path to write to, which replaces `path` at the end.

    So `path` is there whole or not at all, also through a power cut. Every call has its own
    name: calls that write one file, or files that differ in their suffix, do not collide. After an
    error the temporary file is removed.
    """
    partial = path.with_name(f"{path.stem}.{uuid.uuid4().hex}.partial{path.suffix}")
    try:
        with named(str(path)):
            yield partial
            with open(partial, "rb+") as file:
                os.fsync(file.fileno())
            os.replace(partial, path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def replace(path: Path, content: bytes) -> None:
    """Put a file in place, whole or not at all, also through a power cut."""
    with writing(path) as partial:
        partial.write_bytes(content)


def replace_checked(path: Path, content: bytes) -> None:
    """Put a file in place as `replace` does, behind the checksum of its content."""
    replace(path, hashlib.sha256(content).digest() + content)


def read_checked(path: Path) -> bytes:
    """Return the content of a file behind its checksum; raises ValueError where it is damaged."""
    both = path.read_bytes()
    known, content = both[:32], both[32:]
    if hashlib.sha256(content).digest() != known:
        raise ValueError(f"{path} does not match its checksum.")
    return content


def checksum(path: Path, *, sync: bool = False) -> str:
    """SHA-256 of a file; with `sync`, of one that is on the disk when this returns."""
    with open(path, "rb") as file:
        if sync:
            os.fsync(file.fileno())
        return hashlib.file_digest(file, "sha256").hexdigest()


def broken(folder: Path, checksums: dict[str, str]) -> str:
    """Say what is wrong with the first bad file of a table of checksums, or nothing."""
    for name, expected in checksums.items():
        try:
            if checksum(folder / name) != expected:
                return f"{name} does not match its checksum"
        except OSError as error:
            return f"{name}: {error.strerror}"
    return ""


def lock(path: Path, what: str) -> int:
    """The descriptor of a locked file; closing it, or the process's end, frees the lock.

    Raises RuntimeError, with what the holder wrote into the file, if another one holds it.
    """
    import fcntl  # Not on Windows; the rest of the package works there.

    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = os.read(descriptor, 200).decode(errors="replace")
        os.close(descriptor)
        raise RuntimeError(f"{what} is in use by {holder or 'another run'}.") from None
    except OSError:
        os.close(descriptor)
        raise
    os.truncate(descriptor, 0)
    os.write(descriptor, f"process {os.getpid()} on {platform.node()}".encode())
    return descriptor
