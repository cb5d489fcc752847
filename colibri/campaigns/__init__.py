"""Plan, fly, record and tabulate many flights."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.campaigns.factors import CampaignError as CampaignError
    from colibri.campaigns.results import CampaignResults as CampaignResults
    from colibri.campaigns.run import campaign as campaign
else:
    __getattr__, __dir__ = public(__name__)
