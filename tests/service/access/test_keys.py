"""Keys: what proves one, what the file keeps, how signed addresses are checked, and the commands that make them."""

from __future__ import annotations

import os
import stat
import time
from pathlib import Path
from urllib.parse import parse_qsl, quote

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lichen_cli.main import main
from lichen_service.access import keys, signing
from lichen_service.access.keys import KeyFile, Keys, SigningKey
from lichen_service.http.target import split_target

SIGNER = SigningKey("aaaaaaaa", "a secret")
TARGET = "/v1/operations/perlin?width=64&height=32&note=a%20b"


def test_a_token_proves_its_key_and_no_other_text_does() -> None:
    known, key, token = Keys().add(("run",), note="gate")
    assert known.bearer(token) == key
    assert key.scopes == ("run",)
    for wrong in ("", "lichen_", token[:-1], token + "a", token.upper(), f"lichen_{key.id}_{'A' * 43}", key.digest):
        assert known.bearer(wrong) is None


def test_the_file_holds_nothing_that_opens_a_door(tmp_path: Path) -> None:
    known, _, token = Keys().add()
    path = tmp_path / "new" / "keys.json"
    keys.write(path, known)
    assert token.rpartition("_")[2] not in path.read_text()
    assert stat.S_IMODE(os.stat(path).st_mode) == 0o600
    assert keys.read(path) == known
    assert os.listdir(path.parent) == ["keys.json"]


def test_a_revoked_key_ends_at_once_and_a_broken_file_ends_all(tmp_path: Path) -> None:
    path = tmp_path / "keys.json"
    known, key, token = Keys().add()
    keys.write(path, known)
    file = KeyFile(path)
    assert file.current().bearer(token) == key
    revoked = known.revoke(key.id)
    assert revoked is not None
    assert revoked.revoke(key.id) is None
    keys.write(path, revoked)
    assert file.current().bearer(token) is None
    keys.write(path, known)
    assert file.current().bearer(token) == key
    for broken in ("{", "[]", '{"keys": [{"id": 1}], "signing": []}'):
        path.write_text(broken)
        assert file.current() == Keys()
    path.unlink()
    assert file.current() == Keys()


def signed(target: str = TARGET, seconds: int = 60) -> tuple[str, tuple[tuple[str, str], ...]]:
    return split_target(signing.sign(target, SIGNER, int(time.time()) + seconds))


def test_a_signed_address_is_good_until_it_expires_or_its_key_ends() -> None:
    known = Keys(signing=(SIGNER,))
    path, query = signed()
    assert signing.verify(path, query, known) == SIGNER
    assert signing.without_signature(query) == tuple(parse_qsl(TARGET.partition("?")[2]))
    with pytest.raises(signing.BadSignature, match="expired"):
        signing.verify(path, query, known, now=time.time() + 61)
    ended = known.revoke(SIGNER.id)
    assert ended is not None
    with pytest.raises(signing.BadSignature):
        signing.verify(path, query, ended)


def test_no_part_of_a_signed_address_can_be_changed() -> None:
    known = Keys(signing=(SIGNER, SigningKey("bbbbbbbb", "another secret")))
    path, query = signed()
    changes: list[tuple[str, tuple[tuple[str, str], ...]]] = [
        ("/v1/operations/simplex", query),
        (path, query[:-1]),
        (path, (*query, ("width", "1"))),
        (path, (("width", "1"), *query)),
        (path, (query[1], query[0], *query[2:])),
        (path, tuple((name, "9999999999" if name == signing.EXPIRES else value) for name, value in query)),
        (path, tuple((name, "bbbbbbbb" if name == signing.KEY else value) for name, value in query)),
        (path, tuple((name, "cccccccc" if name == signing.KEY else value) for name, value in query)),
        (path, (*query[:-1], ("signature", query[-1][1].swapcase()))),
        (path, (*query[:-1], ("signature", "\u00e9"))),
        (path, (*query[:-1], query[-1], query[-1])),
        (path, ()),
    ]
    for changed in changes:
        with pytest.raises(signing.BadSignature):
            signing.verify(*changed, known)


@given(
    st.lists(
        st.tuples(
            st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1),
            st.text(st.characters(codec="utf-8", exclude_characters="\0")),
        ),
        max_size=4,
    )
)
def test_every_query_can_be_signed(pairs: list[tuple[str, str]]) -> None:
    target = "/a%20b/c?" + "&".join(f"{quote(name, safe='')}={quote(value, safe='')}" for name, value in pairs)
    path, query = signed(target)
    assert signing.verify(path, query, Keys(signing=(SIGNER,))) == SIGNER
    assert signing.without_signature(query) == tuple(pairs)


def test_an_address_is_signed_once() -> None:
    with pytest.raises(ValueError, match="already"):
        signing.sign(signing.sign(TARGET, SIGNER, 1), SIGNER, 1)


def test_the_commands_make_list_and_end_keys(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "keys.json"
    at = ["--keys", str(path)]
    assert main(["keys", "add", "--note", "the gate", "--scope", "run", "--rate", "60", *at]) == 0
    token = capsys.readouterr().out.strip()
    key = keys.read(path).bearer(token)
    assert key is not None
    assert (key.scopes, key.rate, key.note) == (("run",), 60, "the gate")
    assert main(["keys", "add", "--signing", *at]) == 0
    assert keys.read(path).signing[0].secret == capsys.readouterr().out.strip()
    assert main(["keys", "sign", TARGET, *at]) == 0
    assert signing.verify(*split_target(capsys.readouterr().out.strip()), keys.read(path))
    assert main(["keys", "list", *at]) == 0
    shown = capsys.readouterr().out
    assert key.id in shown
    assert "the gate" in shown
    assert token not in shown
    assert main(["keys", "revoke", key.id, *at]) == 0
    assert keys.read(path).bearer(token) is None
    assert main(["keys", "revoke", key.id, *at]) == 1
    assert main(["keys", "sign", TARGET, "--key", "nobody", *at]) == 1
    assert main(["keys", "add", "--rate", "-1", *at]) == 2
