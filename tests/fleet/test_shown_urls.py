"""A URL is shown without what lets somebody in."""

import pytest

from selector.fleet.places import is_url, without_password


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("smb://shop:secret@server/plant", "smb://…@server/plant"),
        ("smb://shop:sec@ret@server/plant", "smb://…@server/plant"),
        ("smb://shop:sec/ret@server/plant", "smb://…@server/plant"),
        ("https://server/run.csv?sig=secret&x=1", "https://server/run.csv?…"),
        ("s3://plant/m?/run*.csv", "s3://plant/m?/run*.csv"),
        ("s3://plant/m01", "s3://plant/m01"),
    ],
)
def test_account_and_signature_are_hidden_and_nothing_else(url: str, shown: str) -> None:
    assert without_password(url) == shown


def test_what_names_no_server_is_a_path() -> None:
    assert [is_url(one) for one in ("s3://a", "simplecache::s3://a", "://a", "a:/b", "")] == [
        True,
        True,
        False,
        False,
        False,
    ]
