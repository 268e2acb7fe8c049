"""An open bus for asyncio, apart from `opening`, so that a blocking program does not import asyncio."""

from __future__ import annotations

from typing import Self

from motorbus.bus.aio import AsyncBus
from motorbus.errors import MotorbusError
from motorbus.session.echo import LOG, echo_test, warn_of_echo


class OpenAsyncBus(AsyncBus):
    """An async bus that tests for echo when its `async with` is entered."""

    async def __aenter__(self) -> Self:
        test = echo_test(self)
        if test is not None:
            try:
                await self.run(test)
            except MotorbusError as silence:
                LOG.debug("echo test: %s", silence.summary)
            except BaseException:  # cancelled: `__aexit__` is not called
                await self.close()
                raise
            warn_of_echo(self)
        return self
