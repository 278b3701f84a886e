"""``robotd features``: list the installed features."""

from __future__ import annotations

import click

from robotd.api.commands import as_json, log_options
from robotd.api.features import feature_failures, installed_features
from robotd_inventory.listing import Row, print_rows


@click.command("features")
@as_json
@log_options
def features(*, as_json: bool) -> None:
    """List the features that run alongside a robot."""
    rows: list[Row] = [
        {
            "name": name,
            "summary": feature.summary,
            "keys": list(feature.keys),
            "options": [option.flag for option in feature.options],
            "guards": list(feature.guards),
            "problem": None,
        }
        for name, feature in installed_features().items()
    ]
    lists = ("keys", "options", "guards")
    rows += [
        {"name": origin.name, "summary": "", **{key: [] for key in lists}, "problem": reason}
        for origin, reason in feature_failures().items()
    ]
    print_rows(rows, lists, as_json=as_json)
