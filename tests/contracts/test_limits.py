"""The limits of estimates, fleets, campaigns and streams: unit, meaning and source; the pages hold all."""

from dataclasses import fields, replace

import pytest

from estimator.filters.policy import POLICY as OF_FILTER
from estimator.limits import Limits
from estimator.monitoring.policy import POLICY as OF_TEST
from scenarios.campaign.policy import POLICY as OF_CAMPAIGN
from scenarios.estimating.policy import POLICY as OF_ESTIMATE
from scenarios.fleet.policy import POLICY as OF_FLEET
from scenarios.watching.policy import POLICY as OF_WATCH
from tests.helpers.paths import ROOT

POLICIES = {
    "estimate": [OF_FILTER, OF_ESTIMATE],
    "fleet": [OF_FLEET],
    "campaign": [OF_CAMPAIGN],
    "watch": [OF_TEST, OF_WATCH],
}
ALL = [p for some in POLICIES.values() for p in some]


@pytest.mark.parametrize("policy", ALL, ids=lambda p: type(p).__name__)
def test_every_limit_has_a_unit_a_meaning_and_a_source(policy):
    assert type(policy).__mro__[1] is Limits
    for f in fields(policy):
        assert {k: bool(v) for k, v in f.metadata.items()} == {"unit": True, "meaning": True, "source": True}
        other = replace(policy, **{f.name: getattr(policy, f.name) + 1})
        assert other.version != policy.version


@pytest.mark.parametrize("page", POLICIES)
def test_the_page_of_a_command_holds_its_limits(page):
    """As written by Limits.table."""
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    for policy in POLICIES[page]:
        assert policy.table() in text
