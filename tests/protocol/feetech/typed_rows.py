"""Every row of all six register maps, typed by hand from the vendor's data and from nothing of this project."""

from __future__ import annotations

from typing import Final

# Each line: address, name, bytes, EEPROM/RAM/factory, access, bit of the sign (- unsigned), lowest, highest : maps.
ROWS: Final = """
0 firmware_major 1 E r - 0 255 : all
1 firmware_minor 1 E r - 0 255 : all
2 byte_order 1 E r - 0 1 : all
3 model_major 1 E r - 0 255 : all
4 model_minor 1 E r - 0 255 : all
5 id 1 E rw - 0 253 : all
6 baud_rate 1 E rw - 0 7 : sts smcl scs2 hls
6 baud_rate 1 E rw - 0 11 : smbl
6 baud_rate 1 E rw - 0 10 : scs
7 return_delay 1 E rw - 0 254 : sts smbl smcl scs scs2
7 second_id 1 E rw - 0 253 : hls
8 status_return_level 1 E rw - 0 1 : all
9 min_position_limit 2 E rw 15 0 4094 : sts smbl smcl hls
9 min_position_limit 2 E rw - 0 1023 : scs scs2
11 max_position_limit 2 E rw 15 0 4095 : sts smbl smcl hls
11 max_position_limit 2 E rw - 0 1023 : scs scs2
13 max_temperature 1 E rw - 0 100 : all
14 max_voltage 1 E rw - 0 254 : all
15 min_voltage 1 E rw - 0 254 : all
16 max_torque 2 E rw - 0 1000 : all
18 phase 1 E rw - 0 255 : sts smbl scs scs2 hls
18 phase 1 E rw - 0 254 : smcl
19 unload_mask 1 E rw - 0 255 : all
20 led_mask 1 E rw - 0 255 : all
21 position_p 1 E rw - 0 254 : all
22 position_d 1 E rw - 0 254 : all
23 position_i 1 E rw - 0 254 : sts smbl smcl scs hls
24 min_start_force 1 E rw - 0 254 : sts smbl hls
24 min_start_force 2 E rw - 0 1000 : smcl scs scs2
25 integral_limit 1 E rw - 0 254 : sts smbl hls
26 dead_band_cw 1 E rw - 0 32 : sts smbl smcl scs scs2
26 dead_band_cw 1 E rw - 0 16 : hls
27 dead_band_ccw 1 E rw - 0 32 : sts smbl smcl scs scs2
27 dead_band_ccw 1 E rw - 0 16 : hls
28 protection_current 2 E rw - 0 1023 : sts smbl smcl
28 hysteresis 1 E rw - 0 254 : scs scs2
28 protection_current 2 E rw - 0 2047 : hls
30 angular_resolution 1 E rw - 1 4 : sts
30 angular_resolution 1 E rw - 1 128 : smbl hls
31 homing_offset 2 E rw 11 -2047 2047 : sts smbl
31 overcurrent_time 1 E rw - 0 254 : scs2
31 homing_offset 2 E rw 15 -4095 4095 : hls
32 protection_current 2 E rw - 0 1023 : scs2
33 operating_mode 1 E rw - 0 3 : sts smbl
33 homing_offset 2 E rw 11 -2047 2047 : smcl
33 operating_mode 1 E rw - 0 4 : hls
34 protective_torque 1 E rw - 0 100 : sts smbl
34 homing_offset 1 E rw 7 -127 127 : scs2
34 current_p 1 E rw - 0 254 : hls
35 overload_time 1 E rw - 0 254 : sts smbl
35 operating_mode 1 E rw - 0 2 : smcl
35 current_i 1 E rw - 0 254 : hls
36 overload_torque 1 E rw - 0 100 : sts smbl
36 overcurrent_time 1 E rw - 0 254 : smcl
37 velocity_p 1 E rw - 0 254 : sts smbl hls
37 protective_torque 1 E rw - 0 100 : smcl scs scs2
38 overcurrent_time 1 E rw - 0 254 : sts smbl hls
38 overload_time 1 E rw - 0 254 : smcl scs scs2
39 velocity_i 1 E rw - 0 254 : sts smbl hls
39 overload_torque 1 E rw - 0 100 : smcl scs scs2
40 torque_enable 1 S rw - 0 128 : sts smbl smcl
40 torque_enable 1 S rw - 0 2 : scs scs2 hls
41 acceleration 1 S rw - 0 254 : sts smbl smcl hls
42 goal_position 2 S rw 15 -32766 32766 : sts smbl smcl hls
42 goal_position 2 S rw - 0 1023 : scs scs2
44 goal_time 2 S rw 10 -1000 1000 : sts smbl smcl
44 goal_time 2 S rw - 0 65535 : scs scs2
44 goal_torque 2 S rw 15 -2047 2047 : hls
46 goal_velocity 2 S rw 15 -32766 32766 : sts smbl hls
46 goal_velocity 2 S rw 15 0 32766 : smcl
46 goal_velocity 2 S rw - 0 32766 : scs scs2
48 torque_limit 2 S rw - 0 1000 : sts smbl hls
48 lock 1 S rw - 0 1 : smcl scs scs2
50 live_p 1 S rw - 0 254 : hls
51 live_d 1 S rw - 0 254 : hls
52 live_i 1 S rw - 0 254 : hls
53 control_loop 1 S rw - 0 1 : hls
55 lock 1 S rw - 0 1 : sts smbl hls
56 present_position 2 S r 15 -32767 32767 : all
58 present_velocity 2 S r 15 -32767 32767 : all
60 present_load 2 S r 10 -1000 1000 : all
62 present_voltage 1 S r - 0 255 : all
63 present_temperature 1 S r - 0 255 : all
64 reg_write_pending 1 S r - 0 1 : all
65 hardware_error 1 S r - 0 255 : all
66 moving 1 S r - 0 1 : sts smbl smcl scs scs2
66 moving 1 S r - 0 3 : hls
67 goal_position_echo 2 S r 15 -32767 32767 : sts smbl hls
69 present_current 2 S r 15 -32767 32767 : all
73 current_zero_offset 2 S r 15 -32767 32767 : hls
77 vfk 1 F r - 0 255 : hls
78 pwm_max_step 1 F r - 0 255 : scs scs2
78 vkgi 1 F r - 0 255 : hls
79 moving_threshold 1 F r - 0 255 : scs scs2
79 pfk 1 F r - 0 255 : hls
80 moving_threshold 1 F r - 0 255 : sts smbl hls
80 dts 1 F r - 0 255 : scs scs2
81 dts 1 F r - 0 255 : sts smbl hls
81 min_velocity_limit 1 F r - 0 255 : scs scs2
82 velocity_unit 1 F r - 0 255 : sts smbl
82 max_velocity_limit 1 F r - 0 255 : scs scs2
82 efk 1 F r - 0 255 : hls
83 hts 1 F r - 0 255 : sts smbl
83 factory_acceleration 1 F r - 0 255 : scs scs2
83 vk 1 F r - 0 255 : hls
84 max_velocity_limit 1 F r - 0 255 : sts smbl hls
85 max_acceleration 1 F r - 0 255 : sts smbl hls
86 acceleration_multiplier 1 F r - 0 255 : sts smbl hls
"""

# Addresses of rows on which the published sources disagree, or which none of them confirms: FD's configuration against
# the vendor's memory tables, SDK headers, measurements and what other projects wrote down.
IN_DOUBT: Final = {
    "sts": (6, 7, 11, 14, 19, 20, 24, 25, 28, 30, 31, 34, 36, 40, 41, 44, 55, 65, 67),
    "smbl": (6, 19, 20, 24, 25, 34, 36, 44, 65, 67),
    "smcl": (6, 19, 20, 28, 33, 37, 39, 41, 42, 44, 46, 65),
    "scs": (2, 5, 6, 7, 9, 11, 23, 28, 37, 39, 44, 69),
    "scs2": (2, 5, 6, 7, 9, 11, 28, 37, 39, 44, 78, 79, 80, 81, 82, 83),
    "hls": (6, 26, 27, 28, 33, 40, 44, 48),
}
