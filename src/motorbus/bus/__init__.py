"""Who talks when. One link, one bus: policy in `turns`, waiting in `pump` (blocking) and `aio` (async)."""
