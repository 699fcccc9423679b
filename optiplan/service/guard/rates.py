"""How often clients ask: a bucket of tokens each, which fills at a constant rate."""

import ipaddress
import time
from collections import OrderedDict

CLIENTS = 10_000
"""Clients that are remembered; the one that asked longest ago is forgotten first."""


def client_of(host: str) -> str:
    """Whom an address stands for: of IPv6 the network of 64 bits, of which one client has all addresses."""
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return host
    if address.version == 4 or address.ipv4_mapped:
        return str(address.ipv4_mapped if address.version == 6 else address)
    return str(ipaddress.ip_network((address, 64), strict=False))


class Rates:
    """Limit of requests of each client.

    Args:
        rate: requests a second in the long run.
        burst: requests at once.
    """

    def __init__(self, rate: float, burst: int) -> None:
        self._rate, self._burst = rate, float(burst)
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait(self, client: str) -> float:
        """Count a request of a client; return the seconds it has to wait, 0 if it may pass."""
        now = time.monotonic()
        left, then = self._buckets.pop(client, (self._burst, now))
        left = min(self._burst, left + (now - then) * self._rate)
        passes = left >= 1.0
        self._buckets[client] = (left - 1.0 if passes else left, now)
        if len(self._buckets) > CLIENTS:
            self._buckets.popitem(last=False)
        return 0.0 if passes else (1.0 - left) / self._rate
