"""Every row of all six register maps, typed by hand from the vendor's data and from nothing of this project.

Rows that all maps have alike come once; of the rest each map has its own full list, also where two maps agree.
"""

from __future__ import annotations

from typing import Final

# Each line: address, name, bytes, EEPROM/RAM/factory, access, bit of the sign (- unsigned), lowest, highest.
COMMON: Final = """
0 firmware_major 1 E r - 0 255
1 firmware_minor 1 E r - 0 255
2 byte_order 1 E r - 0 1
3 model_major 1 E r - 0 255
4 model_minor 1 E r - 0 255
5 id 1 E rw - 0 253
8 status_return_level 1 E rw - 0 1
13 max_temperature 1 E rw - 0 100
14 max_voltage 1 E rw - 0 254
15 min_voltage 1 E rw - 0 254
16 max_torque 2 E rw - 0 1000
19 unload_mask 1 E rw - 0 255
20 led_mask 1 E rw - 0 255
21 position_p 1 E rw - 0 254
22 position_d 1 E rw - 0 254
56 present_position 2 S r 15 -32767 32767
58 present_velocity 2 S r 15 -32767 32767
60 present_load 2 S r 10 -1000 1000
62 present_voltage 1 S r - 0 255
63 present_temperature 1 S r - 0 255
64 reg_write_pending 1 S r - 0 1
65 hardware_error 1 S r - 0 255
69 present_current 2 S r 15 -32767 32767
"""
ROWS: Final = {
    "sts": """
6 baud_rate 1 E rw - 0 7
7 return_delay 1 E rw - 0 254
9 min_position_limit 2 E rw 15 0 4094
11 max_position_limit 2 E rw 15 0 4095
18 phase 1 E rw - 0 255
23 position_i 1 E rw - 0 254
24 min_start_force 1 E rw - 0 254
25 integral_limit 1 E rw - 0 254
26 dead_band_cw 1 E rw - 0 32
27 dead_band_ccw 1 E rw - 0 32
28 protection_current 2 E rw - 0 1023
30 angular_resolution 1 E rw - 1 4
31 homing_offset 2 E rw 11 -2047 2047
33 operating_mode 1 E rw - 0 3
34 protective_torque 1 E rw - 0 100
35 overload_time 1 E rw - 0 254
36 overload_torque 1 E rw - 0 100
37 velocity_p 1 E rw - 0 254
38 overcurrent_time 1 E rw - 0 254
39 velocity_i 1 E rw - 0 254
40 torque_enable 1 S rw - 0 128
41 acceleration 1 S rw - 0 254
42 goal_position 2 S rw 15 -32766 32766
44 goal_time 2 S rw 10 -1000 1000
46 goal_velocity 2 S rw 15 -32766 32766
48 torque_limit 2 S rw - 0 1000
55 lock 1 S rw - 0 1
66 moving 1 S r - 0 1
67 goal_position_echo 2 S r 15 -32767 32767
80 moving_threshold 1 F r - 0 255
81 dts 1 F r - 0 255
82 velocity_unit 1 F r - 0 255
83 hts 1 F r - 0 255
84 max_velocity_limit 1 F r - 0 255
85 max_acceleration 1 F r - 0 255
86 acceleration_multiplier 1 F r - 0 255
""",
    "smbl": """
6 baud_rate 1 E rw - 0 11
7 return_delay 1 E rw - 0 254
9 min_position_limit 2 E rw 15 0 4094
11 max_position_limit 2 E rw 15 0 4095
18 phase 1 E rw - 0 255
23 position_i 1 E rw - 0 254
24 min_start_force 1 E rw - 0 254
25 integral_limit 1 E rw - 0 254
26 dead_band_cw 1 E rw - 0 32
27 dead_band_ccw 1 E rw - 0 32
28 protection_current 2 E rw - 0 1023
30 angular_resolution 1 E rw - 1 128
31 homing_offset 2 E rw 11 -2047 2047
33 operating_mode 1 E rw - 0 3
34 protective_torque 1 E rw - 0 100
35 overload_time 1 E rw - 0 254
36 overload_torque 1 E rw - 0 100
37 velocity_p 1 E rw - 0 254
38 overcurrent_time 1 E rw - 0 254
39 velocity_i 1 E rw - 0 254
40 torque_enable 1 S rw - 0 128
41 acceleration 1 S rw - 0 254
42 goal_position 2 S rw 15 -32766 32766
44 goal_time 2 S rw 10 -1000 1000
46 goal_velocity 2 S rw 15 -32766 32766
48 torque_limit 2 S rw - 0 1000
55 lock 1 S rw - 0 1
66 moving 1 S r - 0 1
67 goal_position_echo 2 S r 15 -32767 32767
80 moving_threshold 1 F r - 0 255
81 dts 1 F r - 0 255
82 velocity_unit 1 F r - 0 255
83 hts 1 F r - 0 255
84 max_velocity_limit 1 F r - 0 255
85 max_acceleration 1 F r - 0 255
86 acceleration_multiplier 1 F r - 0 255
""",
    "smcl": """
6 baud_rate 1 E rw - 0 7
7 return_delay 1 E rw - 0 254
9 min_position_limit 2 E rw 15 0 4094
11 max_position_limit 2 E rw 15 0 4095
18 phase 1 E rw - 0 254
23 position_i 1 E rw - 0 254
24 min_start_force 2 E rw - 0 1000
26 dead_band_cw 1 E rw - 0 32
27 dead_band_ccw 1 E rw - 0 32
28 protection_current 2 E rw - 0 1023
33 homing_offset 2 E rw 11 -2047 2047
35 operating_mode 1 E rw - 0 2
36 overcurrent_time 1 E rw - 0 254
37 protective_torque 1 E rw - 0 100
38 overload_time 1 E rw - 0 254
39 overload_torque 1 E rw - 0 100
40 torque_enable 1 S rw - 0 128
41 acceleration 1 S rw - 0 254
42 goal_position 2 S rw 15 -32766 32766
44 goal_time 2 S rw 10 -1000 1000
46 goal_velocity 2 S rw 15 0 32766
48 lock 1 S rw - 0 1
66 moving 1 S r - 0 1
""",
    "scs": """
6 baud_rate 1 E rw - 0 10
7 return_delay 1 E rw - 0 254
9 min_position_limit 2 E rw - 0 1023
11 max_position_limit 2 E rw - 0 1023
18 phase 1 E rw - 0 255
23 position_i 1 E rw - 0 254
24 min_start_force 2 E rw - 0 1000
26 dead_band_cw 1 E rw - 0 32
27 dead_band_ccw 1 E rw - 0 32
28 hysteresis 1 E rw - 0 254
37 protective_torque 1 E rw - 0 100
38 overload_time 1 E rw - 0 254
39 overload_torque 1 E rw - 0 100
40 torque_enable 1 S rw - 0 2
42 goal_position 2 S rw - 0 1023
44 goal_time 2 S rw - 0 65535
46 goal_velocity 2 S rw - 0 32766
48 lock 1 S rw - 0 1
66 moving 1 S r - 0 1
78 pwm_max_step 1 F r - 0 255
79 moving_threshold 1 F r - 0 255
80 dts 1 F r - 0 255
81 min_velocity_limit 1 F r - 0 255
82 max_velocity_limit 1 F r - 0 255
83 factory_acceleration 1 F r - 0 255
""",
    "scs2": """
6 baud_rate 1 E rw - 0 7
7 return_delay 1 E rw - 0 254
9 min_position_limit 2 E rw - 0 1023
11 max_position_limit 2 E rw - 0 1023
18 phase 1 E rw - 0 255
24 min_start_force 2 E rw - 0 1000
26 dead_band_cw 1 E rw - 0 32
27 dead_band_ccw 1 E rw - 0 32
28 hysteresis 1 E rw - 0 254
31 overcurrent_time 1 E rw - 0 254
32 protection_current 2 E rw - 0 1023
34 homing_offset 1 E rw 7 -127 127
37 protective_torque 1 E rw - 0 100
38 overload_time 1 E rw - 0 254
39 overload_torque 1 E rw - 0 100
40 torque_enable 1 S rw - 0 2
42 goal_position 2 S rw - 0 1023
44 goal_time 2 S rw - 0 65535
46 goal_velocity 2 S rw - 0 32766
48 lock 1 S rw - 0 1
66 moving 1 S r - 0 1
78 pwm_max_step 1 F r - 0 255
79 moving_threshold 1 F r - 0 255
80 dts 1 F r - 0 255
81 min_velocity_limit 1 F r - 0 255
82 max_velocity_limit 1 F r - 0 255
83 factory_acceleration 1 F r - 0 255
""",
    "hls": """
6 baud_rate 1 E rw - 0 7
7 second_id 1 E rw - 0 253
9 min_position_limit 2 E rw 15 0 4094
11 max_position_limit 2 E rw 15 0 4095
18 phase 1 E rw - 0 255
23 position_i 1 E rw - 0 254
24 min_start_force 1 E rw - 0 254
25 integral_limit 1 E rw - 0 254
26 dead_band_cw 1 E rw - 0 16
27 dead_band_ccw 1 E rw - 0 16
28 protection_current 2 E rw - 0 2047
30 angular_resolution 1 E rw - 1 128
31 homing_offset 2 E rw 15 -4095 4095
33 operating_mode 1 E rw - 0 4
34 current_p 1 E rw - 0 254
35 current_i 1 E rw - 0 254
37 velocity_p 1 E rw - 0 254
38 overcurrent_time 1 E rw - 0 254
39 velocity_i 1 E rw - 0 254
40 torque_enable 1 S rw - 0 2
41 acceleration 1 S rw - 0 254
42 goal_position 2 S rw 15 -32766 32766
44 goal_torque 2 S rw 15 -2047 2047
46 goal_velocity 2 S rw 15 -32766 32766
48 torque_limit 2 S rw - 0 1000
50 live_p 1 S rw - 0 254
51 live_d 1 S rw - 0 254
52 live_i 1 S rw - 0 254
53 control_loop 1 S rw - 0 1
55 lock 1 S rw - 0 1
66 moving 1 S r - 0 3
67 goal_position_echo 2 S r 15 -32767 32767
73 current_zero_offset 2 S r 15 -32767 32767
77 vfk 1 F r - 0 255
78 vkgi 1 F r - 0 255
79 pfk 1 F r - 0 255
80 moving_threshold 1 F r - 0 255
81 dts 1 F r - 0 255
82 efk 1 F r - 0 255
83 vk 1 F r - 0 255
84 max_velocity_limit 1 F r - 0 255
85 max_acceleration 1 F r - 0 255
86 acceleration_multiplier 1 F r - 0 255
""",
}

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
