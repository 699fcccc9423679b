"""`ResultFolder`: where the files of a study go, beside files of the user's that may have their names."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from optiplan.errors import InputError, Issue
from optiplan.files import write_together
from optiplan.records import dataclass
from optiplan.runs.run_folder import check_folder


@dataclass(frozen=True)
class ResultFolder:
    """The files of a study in a folder: those of an earlier result are replaced, or removed, and none of the user's.

    The page ends with the SHA-256 of `perhaps`, which tells that file from one of the user's, such as the problem or
    the robot that the study is about.

    Attributes:
        page: the name of a page that every result has.
        perhaps: the name of a file that some results have.
    """

    page: str
    perhaps: str

    def check(self, folder: Path) -> None:
        """Check that a result can be written to a folder.

        Raises:
            InputError: the folder cannot be written, or has a file `perhaps` that no earlier result left there,
                or only one of an older version, whose page has no such mark.
        """
        check_folder(folder)
        there = folder / self.perhaps
        if (there.exists() or there.is_symlink()) and not self._is_of_a_result(folder):
            found = "a file that no earlier result left there, or one of an older version, or that was changed since"
            raise InputError([Issue(str(there), None, "out", found, "another folder, or this file elsewhere")])

    def write(self, folder: Path, files: Mapping[str, bytes]) -> list[Path]:
        """Write a result and return the paths.

        Args:
            folder: made when it is not there.
            files: content by name, the page among them.

        Raises:
            InputError: as `check`.
            OSError: a file cannot be written; where that is its content, the earlier result is as it was.
        """
        self.check(folder)
        if self.perhaps in files:
            files = {**files, self.page: files[self.page] + self._mark(files[self.perhaps])}
        write_together(folder, files, self.page, [self.perhaps])
        return [folder / name for name in files]

    def _mark(self, content: bytes) -> bytes:
        return f"\n<!-- {self.perhaps}: SHA-256 {hashlib.sha256(content).hexdigest()} -->\n".encode()

    def _is_of_a_result(self, folder: Path) -> bool:
        try:
            return (folder / self.page).read_bytes().endswith(self._mark((folder / self.perhaps).read_bytes()))
        except OSError:
            return False
