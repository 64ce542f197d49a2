"""The table of faults in the documents is that of the tests."""

from tests.fault_table import FILE, page


def test_the_table_is_that_of_the_tests():
    assert FILE.read_text(encoding="utf-8") == page(), "run `python -m tests.fault_table`"
