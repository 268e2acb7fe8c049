"""FEETECH SCS, SMS, STS and HLS servos on a half-duplex serial bus: all six register maps."""
