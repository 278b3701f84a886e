"""Times of a service that answers from memory, each call after a rest.

``python -m tools.bench.service_client SERVICE COUNT`` prints JSON. ``SERVICE`` is a
std_srvs/Trigger. During the rest other programs replace the caches of both processes, as before a
goal.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np
import rclpy
from std_srvs.srv import Trigger
from tools.bench.fast_client import FastClient
from tools.bench.percentiles import percentiles

REST_S = 0.1


def main(service: str, count: int) -> None:
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("service_client", context=context)
    client = FastClient(node, Trigger, service)
    request = client.prepare(Trigger.Request())
    times_us = []
    for _ in range(count):
        time.sleep(REST_S)
        start_ns = client.send(request)
        times_us.append((client.receive()[0] - start_ns) / 1000.0)
    print(json.dumps(percentiles("rested_service", np.array(times_us))))
    node.destroy_node()
    rclpy.shutdown(context=context)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
