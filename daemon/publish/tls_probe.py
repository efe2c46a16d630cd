"""Finds out why a connection to the broker ends without a reason: paho does not pass on what TLS said.

With TLS 1.3 a broker refuses the client's certificate only after the client's handshake is complete. And a broker that
gets no TLS where it expects it, or TLS where it does not, closes the connection. So the probe makes a handshake of its
own, sends nothing, and waits for what the broker says.
"""

from __future__ import annotations

import asyncio
import ssl
from contextlib import suppress
from typing import TYPE_CHECKING

from regolithd.daemon.publish.credentials import tls_context

if TYPE_CHECKING:
    from regolithd.daemon.config.broker import BrokerSettings

HANDSHAKE_TIMEOUT_S = 3.0
REFUSAL_TIMEOUT_S = 1.0
"""A broker that has not refused the certificate within this time after the handshake accepts it."""

NO_TLS_THERE = "the broker speaks no TLS on this port. Correct [mqtt] port, or set tls = false"
TLS_THERE = "the broker expects TLS on this port. Set [mqtt] tls = true, or correct port"


async def tls_problem(settings: BrokerSettings) -> ssl.SSLError | str | None:
    """Return the error of a TLS handshake, a text if one side speaks TLS and the other does not, or None."""
    context = tls_context(settings)
    try:
        if context is None:
            return TLS_THERE if await _speaks_tls(settings) else None
        await _handshake(settings, context)
    except ssl.SSLEOFError:
        return NO_TLS_THERE
    except ssl.SSLError as error:
        return NO_TLS_THERE if error.reason == "WRONG_VERSION_NUMBER" else error
    except ConnectionResetError:
        return NO_TLS_THERE
    except OSError:  # also TimeoutError
        return None
    return None


async def _speaks_tls(settings: BrokerSettings) -> bool:
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE  # only whether: nothing is sent
    try:
        await _handshake(settings, context)
    except ssl.SSLEOFError:
        return False
    except ssl.SSLError as error:
        return error.reason != "WRONG_VERSION_NUMBER"
    except OSError:
        return False
    return True


async def _handshake(settings: BrokerSettings, context: ssl.SSLContext) -> None:
    """Make a handshake, and wait a moment for the broker's alert."""
    async with asyncio.timeout(HANDSHAKE_TIMEOUT_S):
        reader, writer = await asyncio.open_connection(settings.host, settings.port, ssl=context)
    try:
        with suppress(TimeoutError):
            async with asyncio.timeout(REFUSAL_TIMEOUT_S):
                await reader.read(1)
    finally:
        writer.transport.abort()
