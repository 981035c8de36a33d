"""Writing files so that nobody ever finds half of one."""

import os
import tempfile
from pathlib import Path


def replace_file(path: Path, data: bytes) -> None:
    """Make `path` hold `data`: the old file or the new one whole, whatever happens meanwhile. Raises OSError."""
    replace_files({path: data})


def replace_files(contents: dict[Path, bytes]) -> None:
    """Make each path hold its bytes; as long as not all can be written, all stay as they were. Raises OSError.

    Temporary files beside them are flushed to the disk and then renamed over them one after the other, the last one last; then the
    folders are flushed.
    """
    temporaries: dict[Path, Path] = {}
    try:
        for path, data in contents.items():
            handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=".part")
            temporaries[path] = Path(temporary)
            with os.fdopen(handle, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            Path(temporary).chmod(0o644)
        for path, temporary in temporaries.items():
            temporary.replace(path)
    except BaseException:
        for temporary in temporaries.values():
            temporary.unlink(missing_ok=True)
        raise
    for folder in {path.parent for path in contents}:
        _flush_folder(folder)


def _flush_folder(path: Path) -> None:
    if not hasattr(os, "O_DIRECTORY"):
        return
    folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
