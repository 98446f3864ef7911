"""Protocols. PROTOCOLS is the table of all."""

from __future__ import annotations

from bench.protocols.base import Protocol
from bench.protocols.transfer import TRANSFER

PROTOCOLS: dict[str, Protocol] = {protocol.protocol_id: protocol for protocol in (TRANSFER,)}
"""``name@version`` -> protocol."""
