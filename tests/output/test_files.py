"""Paths that are checked, and files that are replaced when they are complete."""

import pytest

from ngcontact.output.files import check_path, replacing


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_a_half_written_file_replaces_none(tmp_path, error):
    old, new = tmp_path / "old.vtu", tmp_path / "new.vtu"
    old.write_text("old")

    def interrupted():
        with replacing(old, new) as drafts:
            for draft in drafts:
                draft.write_text("half a file")
            raise error

    with pytest.raises(error):
        interrupted()
    assert [file.name for file in tmp_path.iterdir()] == ["old.vtu"]
    assert old.read_text() == "old"


@pytest.mark.parametrize(
    ("name", "error", "message"),
    [
        ("a.vtk", ValueError, r"must end in '\.vtu'"),
        ("a", ValueError, r"must end in '\.vtu'"),
        ("none/a.vtu", FileNotFoundError, "there is no folder .*none"),
        ("file/a.vtu", NotADirectoryError, "is not a folder"),
        ("folder.vtu", IsADirectoryError, "it is a folder"),
    ],
)
def test_bad_paths_are_refused(tmp_path, name, error, message):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.vtu").mkdir()
    with pytest.raises(error, match=message):
        check_path(tmp_path / name, ".vtu")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["file", "folder.vtu"]
