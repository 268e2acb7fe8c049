"""The bus: one engine without I/O, a blocking and an asyncio bus around it, the emergency stop.

`tasks` steps procedures, `engine` and `sync` decide what is sent, `blocking` and `aio` do the I/O.
"""
