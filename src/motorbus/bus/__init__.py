"""The bus: one engine without I/O, a blocking and an asyncio bus around it, the emergency stop."""
