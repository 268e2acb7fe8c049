"""An open bus for asyncio, which is imported when somebody asks for one: most programs block and need none of it."""

from __future__ import annotations

from typing import Self

from motorbus.bus.aio import AsyncBus
from motorbus.errors import MotorbusError
from motorbus.session.buses import LOG, echo_test, tell_echo


class OpenAsyncBus(AsyncBus):
    """An async bus that finds out about echo when its `async with` is entered."""

    async def __aenter__(self) -> Self:
        test = echo_test(self)
        if test is not None:
            try:
                await self.run(test)
            except MotorbusError as silence:
                LOG.debug("echo test: %s", silence.summary)
            except BaseException:  # cancelled: whoever is not let in is not shown out either
                await self.close()
                raise
            tell_echo(self)
        return self
