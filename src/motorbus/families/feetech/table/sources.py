"""Where the facts of the register maps come from, each named once, so that every row says it in the same words.

Where two of these disagree, the row's `conflict` says what each of them has and which one was chosen.
"""

from __future__ import annotations

from typing import Final

FD: Final = "FD 1.9.8.5 register configuration"
V36: Final = "STS3215 memory table V3.6"
HLS_TABLE: Final = "HLS memory table"
SCS_TABLE: Final = "SCS memory table 1902 of FD 1.9.8, as published in a public header"
SMS_PAGE: Final = "FEETECH page on SMS servos"
SPECIAL: Final = "FEETECH notes on special bytes of STS servos"
SPECIAL_HLS: Final = "FEETECH notes on special bytes, HLS"
SPECIAL_SCS: Final = "FEETECH notes on special bytes, SCS"
MANUAL: Final = "FEETECH serial bus servo protocol manual V1.01"
SDK: Final = "FEETECH SDK header SMS_STS.h"
SDK_SCS: Final = "FEETECH SDK header SCSCL.h"
SDK_SMSCL: Final = "FEETECH SDK, SMSCL"
SDK_HLS: Final = "FEETECH SDK, hls.py"
LEROBOT: Final = "lerobot, motors/feetech/tables.py"
CLI: Final = "measured by feetech-cli on an STS3215"
HEADERS: Final = "FD: 0 to 7; public headers: 0 to 11. Chosen: 0 to 7"
SERVOLAB: Final = "measured by servolab on an STS3215, firmware 3.10"
