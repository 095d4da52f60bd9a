import unicodedata

from hypothesis import given
from hypothesis import strategies as st

from maipp.route_files.file_names import file_stems

AWKWARD = st.sampled_from(
    ["a", "A", "a-2", "/", "\\", "..", ".", " ", "con", "CON.x", "Nul", "é", "e\u0301", "ß", "ss", "船" * 60]
)


def test_names_are_kept_where_they_can_be():
    assert file_stems(["Nord/Süd 1", "船 二号", "boat.2", "a:b?"]) == ["Nord_Süd 1", "船 二号", "boat.2", "a_b_"]


def test_names_that_come_out_alike_are_numbered():
    assert file_stems(["a/b", "a:b", "A?B", "a_b-2"]) == ["a_b", "a_b-2", "A_B-3", "a_b-2-2"]


def test_devices_and_hidden_files_are_avoided():
    assert file_stems(["con", "Lpt1.txt", ".hidden", "...", "console"]) == [
        "_con",
        "_Lpt1.txt",
        "_.hidden",
        "_",
        "console",
    ]


@given(st.lists(st.lists(AWKWARD | st.text(max_size=5), min_size=1, max_size=4).map("".join), max_size=8))
def test_every_file_system_takes_them_and_tells_them_apart(names):
    names = [name.encode("utf-8", errors="ignore").decode() for name in names]
    stems = file_stems(names)
    assert len(stems) == len(names)
    assert len({unicodedata.normalize("NFC", stem.casefold()) for stem in stems}) == len(stems)
    for stem in stems:
        assert stem and not set(stem) & set('<>:"/\\|?*\x00') and stem.isprintable() | (not stem.isascii())
        assert stem[0] not in ". " and stem[-1] not in ". "
        assert len(f"{stem}.plan".encode()) < 200
        assert stem.split(".")[0].lower() not in ("con", "prn", "aux", "nul", "com1", "lpt1")
