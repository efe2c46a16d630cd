"""Notes the end of a traverse in a file beside the recordings, which starts `regolithd-compare.path`."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # pydantic reads it at run time

from pydantic import BaseModel, ConfigDict

NAME = "last-traverse.json"


class Traversed(BaseModel):
    """When the last traverse began and ended [ns since 1970], and how."""

    model_config = ConfigDict(frozen=True)

    from_ns: int
    to_ns: int
    ending: str

    def write(self, folder: Path) -> None:
        """Write the file at once, so that a reader never sees half of it.

        Raises
        ------
        OSError
            The folder cannot be written.
        """
        draft = folder / f".{NAME}"
        draft.write_text(self.model_dump_json() + "\n", encoding="ascii")
        draft.replace(folder / NAME)

    @classmethod
    def read(cls, folder: Path) -> Traversed:
        """Read the file.

        Raises
        ------
        OSError, ValueError
            There is none, or it is not one.
        """
        return cls.model_validate_json((folder / NAME).read_bytes())
