"""Metrics as a feature."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import TYPE_CHECKING

from pydantic import Field

from robotd.api import OperationError, get_logger
from robotd.api.commands import PORT
from robotd.api.features import Feature, FeatureOption, Section

if TYPE_CHECKING:
    from robotd.api.features import FeatureHost

log = get_logger("metrics")


class MetricsKeys(Section):
    """Keys at the top of a robot's file."""

    metrics: int | None = Field(
        None,
        ge=0,
        le=65535,
        description="Port of the metrics for Prometheus on the loopback interface; 0: any free "
        "one; null: not served.",
    )


FEATURE = Feature(
    summary="metrics for Prometheus",
    settings=MetricsKeys,
    open="robotd_metrics.feature:open_metrics",
    options=(
        FeatureOption(
            "--metrics",
            "metrics",
            "Serve metrics for Prometheus at http://127.0.0.1:PORT/metrics.",
            "PORT",
            PORT,
        ),
    ),
    after=("recorder", "page"),
)


@contextmanager
def open_metrics(host: FeatureHost) -> Iterator[Callable[[], bytes] | None]:
    """Count metrics, and serve them where a port is given; the value returns their text.

    They are counted without a port, too, where another feature shows them.
    """
    port = host.robot.descriptor.settings(MetricsKeys).metrics
    if port is None and "metrics" not in host.requested:
        yield None
        return
    try:
        from prometheus_client import generate_latest

        from robotd_metrics.metrics import registry, serve_metrics
    except ImportError as error:
        if port is None:
            yield None
            return
        text = "--metrics needs prometheus_client: pip install 'robotd[metrics]'"
        raise OperationError(text) from error
    recorder = host.parts.get("recorder")
    made = registry(host.tap(), recorder.flight if recorder else None)
    with ExitStack() as stack:
        if port is not None:
            served = stack.enter_context(serve_metrics(made, port))
            log.info("metrics", url=f"http://127.0.0.1:{served}/metrics")
        yield partial(generate_latest, made)
