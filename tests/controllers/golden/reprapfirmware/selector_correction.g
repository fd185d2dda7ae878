 ; SIGN UNVERIFIED: do the sign test of the commissioning sheet before cutting.
 ; Model: patent CN1868666, two sensors
 ;   Z = -1.871 + 6.0476*dT1 + 2.6667*dT3 [um]
 ;   Y = 0.5703 + 4.7292*dT1 - 0.5908*dT3 [um]
 ; The correction of an axis is the negative of its displacement.
 ; Equations SHA-256 a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f
 ; Written by selector
 ; Single precision: largest difference to the float64 model inside the valid ranges: Z 0.00013 um, Y 7.8e-05 um,
 ;   for readings up to T1 70 degC, T3 70 degC, called at most 100 times a second.
 ; One call of the program; daemon.g calls it. Comments are indented: the
 ; firmware looks for words of slicers in those that are not.
var tested_1 = 0.0
var tested_2 = 0.0
var off_s = 0.0
var passed_s = 0.0
var change = 0.0
var credit_s = 0.0
var x = 0.0
var z_1 = 0.0
var z_2 = 0.0
var own = 0.0
var is_test = false
var slewed_s = 0.0
var towards = 0.0
var most = 0.0
var reach = 0.0
var low = 0.0
var high = 0.0
var holds = false
if !global.selector_is_started
  set global.selector_is_started = true
  if fileexists("selector_kept_a6dda75b.g")
    set global.selector_standstill_s = 1e+06
    M98 P"selector_kept_a6dda75b.g"
    ; a clock that was not set, or was put back, says nothing
    if global.selector_is_restart && state.time != null && global.selector_saved_at > 0
      if +state.time >= global.selector_saved_at
        set global.selector_standstill_s = 0.0 + (+state.time - global.selector_saved_at)
 ; whole seconds: seconds and milliseconds are not read at the same time
var now = state.upTime
set global.selector_dt_s = 0.0 + (var.now - global.selector_called_at)
set global.selector_called_at = var.now
set global.selector_reading_1 = 1e+30
if exists(sensors.analog[global.selector_number_1].lastReading)
  if sensors.analog[global.selector_number_1].state == "ok"
    set global.selector_reading_1 = sensors.analog[global.selector_number_1].lastReading
set global.selector_reading_2 = 1e+30
if exists(sensors.analog[global.selector_number_2].lastReading)
  if sensors.analog[global.selector_number_2].state == "ok"
    set global.selector_reading_2 = sensors.analog[global.selector_number_2].lastReading
var is_zero_1 = global.selector_is_zero_1
var is_zero_2 = global.selector_is_zero_2
set global.selector_is_ready = move.axes[2].homed && move.axes[1].homed
 ; the program
if global.selector_is_restart && !(global.selector_was_restart)
   ; the control was off: memory goes on, the correction begins at zero
  set var.off_s = 0.0
  if global.selector_standstill_s > 0.0
    set var.off_s = global.selector_standstill_s
  if var.off_s > 1e+06
    set var.off_s = 1e+06
  set global.selector_since_1 = global.selector_since_1 + var.off_s
  if global.selector_since_1 > 1e+06
    set global.selector_since_1 = 1e+06
  set global.selector_good_for_1 = -1.0
  set global.selector_is_new_1 = true
  set global.selector_since_2 = global.selector_since_2 + var.off_s
  if global.selector_since_2 > 1e+06
    set global.selector_since_2 = 1e+06
  set global.selector_good_for_2 = -1.0
  set global.selector_is_new_2 = true
  set global.selector_is_first = true
  set global.selector_since_sample_s = 0.0
  set global.selector_held_s = 0.0
  set global.selector_test_left_s = 0.0
  set global.selector_follows = 2
  set global.selector_k0_1 = 0.0
  set global.selector_rest_1 = 0.0
  set global.selector_correction_1 = 0.0
  set global.selector_aim_1 = 0.0
  set global.selector_k0_2 = 0.0
  set global.selector_rest_2 = 0.0
  set global.selector_correction_2 = 0.0
  set global.selector_aim_2 = 0.0
set global.selector_was_restart = global.selector_is_restart
if global.selector_is_first
   ; what was kept is dropped where it cannot be
  if !((global.selector_start_1 > -1e+09 || global.selector_start_1 == -1e+09) && (global.selector_start_1 < 1e+09 || global.selector_start_1 == 1e+09))
    set global.selector_has_memory_1 = false
    set global.selector_has_start_1 = false
  if !((global.selector_start_2 > -1e+09 || global.selector_start_2 == -1e+09) && (global.selector_start_2 < 1e+09 || global.selector_start_2 == 1e+09))
    set global.selector_has_memory_2 = false
    set global.selector_has_start_2 = false
 ; time: what is no time, or too long, counts as 0
set var.passed_s = 0.0
if (global.selector_dt_s > 0.0) && (global.selector_dt_s < 1e+06 || global.selector_dt_s == 1e+06)
  set var.passed_s = global.selector_dt_s
if global.selector_is_zero_1
  set global.selector_k0_1 = 0.0
  set global.selector_rest_1 = 0.0
  set global.selector_correction_1 = 0.0
  set global.selector_aim_1 = 0.0
  set global.selector_zero_waits_1 = true
if global.selector_is_zero_2
  set global.selector_k0_2 = 0.0
  set global.selector_rest_2 = 0.0
  set global.selector_correction_2 = 0.0
  set global.selector_aim_2 = 0.0
  set global.selector_zero_waits_2 = true
set global.selector_since_sample_s = global.selector_since_sample_s + var.passed_s
if global.selector_since_sample_s > 1e+06
  set global.selector_since_sample_s = 1e+06
if global.selector_is_first || (global.selector_since_sample_s > 1.0 || global.selector_since_sample_s == 1.0)
  if global.selector_mode == 5
    set global.selector_test_left_s = global.selector_test_left_s - global.selector_since_sample_s
    if global.selector_test_left_s < 0.0
      set global.selector_test_left_s = 0.0
   ; sensor T1
  if (!(global.selector_has_memory_1) || !(global.selector_has_start_1)) && !(global.selector_is_new_1)
    set global.selector_has_memory_1 = false
    set global.selector_is_new_1 = true
    set global.selector_good_for_1 = -1.0
  set global.selector_since_1 = global.selector_since_1 + global.selector_since_sample_s
  if global.selector_since_1 > 1e+06
    set global.selector_since_1 = 1e+06
  set global.selector_sensor_1 = 0
  if !((global.selector_reading_1 > -1e+09 || global.selector_reading_1 == -1e+09) && (global.selector_reading_1 < 1e+09 || global.selector_reading_1 == 1e+09))
    set global.selector_sensor_1 = 3
  if (global.selector_sensor_1 == 0) && (global.selector_reading_1 > 849.99915 || global.selector_reading_1 == 849.99915) && (global.selector_reading_1 < 850.00085 || global.selector_reading_1 == 850.00085)
    set global.selector_sensor_1 = 4
  if (global.selector_sensor_1 == 0) && (global.selector_reading_1 > -9999.01 || global.selector_reading_1 == -9999.01) && (global.selector_reading_1 < -9998.99 || global.selector_reading_1 == -9998.99)
    set global.selector_sensor_1 = 4
  if (global.selector_sensor_1 == 0) && (global.selector_reading_1 > 9998.99 || global.selector_reading_1 == 9998.99) && (global.selector_reading_1 < 9999.01 || global.selector_reading_1 == 9999.01)
    set global.selector_sensor_1 = 4
  if (global.selector_sensor_1 == 0) && (global.selector_reading_1 > -999.001 || global.selector_reading_1 == -999.001) && (global.selector_reading_1 < -998.999 || global.selector_reading_1 == -998.999)
    set global.selector_sensor_1 = 4
  if (global.selector_sensor_1 == 0) && (global.selector_reading_1 > 32766.967 || global.selector_reading_1 == 32766.967) && (global.selector_reading_1 < 32767.033 || global.selector_reading_1 == 32767.033)
    set global.selector_sensor_1 = 4
  if (global.selector_sensor_1 == 0) && (global.selector_reading_1 > -32768.03 || global.selector_reading_1 == -32768.03) && (global.selector_reading_1 < -32767.967 || global.selector_reading_1 == -32767.967)
    set global.selector_sensor_1 = 4
  if (global.selector_sensor_1 == 0) && (global.selector_reading_1 > 3276.6968 || global.selector_reading_1 == 3276.6968) && (global.selector_reading_1 < 3276.7034 || global.selector_reading_1 == 3276.7034)
    set global.selector_sensor_1 = 4
  if (global.selector_sensor_1 == 0) && (global.selector_reading_1 > -3276.8032 || global.selector_reading_1 == -3276.8032) && (global.selector_reading_1 < -3276.7966 || global.selector_reading_1 == -3276.7966)
    set global.selector_sensor_1 = 4
  if global.selector_sensor_1 == 0
    set var.change = global.selector_reading_1 - global.selector_start_1
    if !(global.selector_has_start_1) && ((var.change > 10.0) || (var.change < -10.0))
      set global.selector_good_for_1 = -1.0
    if (global.selector_good_for_1 > 0.0 || global.selector_good_for_1 == 0.0)
      set var.credit_s = global.selector_since_sample_s
      if var.credit_s > 10.0
        set var.credit_s = 10.0
      set global.selector_good_for_1 = global.selector_good_for_1 + var.credit_s
      if global.selector_good_for_1 > 1e+06
        set global.selector_good_for_1 = 1e+06
    else
      set global.selector_good_for_1 = 0.0
      if !(global.selector_has_memory_1)
        if !(global.selector_has_start_1)
          set global.selector_start_1 = global.selector_reading_1
        set var.x = global.selector_reading_1 - global.selector_start_1
        set global.selector_x_1 = var.x
        if global.selector_x_1 < 0.0
          set global.selector_x_1 = 0.0
        if global.selector_x_1 > 10.0
          set global.selector_x_1 = 10.0
        set global.selector_since_1 = 0.0
    if global.selector_good_for_1 < 60.0
      set global.selector_sensor_1 = 2
    else
      set global.selector_has_start_1 = true
      set var.x = global.selector_reading_1 - global.selector_start_1
      set global.selector_x_1 = var.x
      if global.selector_x_1 < 0.0
        set global.selector_x_1 = 0.0
      if global.selector_x_1 > 10.0
        set global.selector_x_1 = 10.0
      if (var.x < -1e-08) || (var.x > 10.0)
        set global.selector_sensor_1 = 1
  else
    set global.selector_good_for_1 = -1.0
   ; sensor T3
  if (!(global.selector_has_memory_2) || !(global.selector_has_start_2)) && !(global.selector_is_new_2)
    set global.selector_has_memory_2 = false
    set global.selector_is_new_2 = true
    set global.selector_good_for_2 = -1.0
  set global.selector_since_2 = global.selector_since_2 + global.selector_since_sample_s
  if global.selector_since_2 > 1e+06
    set global.selector_since_2 = 1e+06
  set global.selector_sensor_2 = 0
  if !((global.selector_reading_2 > -1e+09 || global.selector_reading_2 == -1e+09) && (global.selector_reading_2 < 1e+09 || global.selector_reading_2 == 1e+09))
    set global.selector_sensor_2 = 3
  if (global.selector_sensor_2 == 0) && (global.selector_reading_2 > 849.99915 || global.selector_reading_2 == 849.99915) && (global.selector_reading_2 < 850.00085 || global.selector_reading_2 == 850.00085)
    set global.selector_sensor_2 = 4
  if (global.selector_sensor_2 == 0) && (global.selector_reading_2 > -9999.01 || global.selector_reading_2 == -9999.01) && (global.selector_reading_2 < -9998.99 || global.selector_reading_2 == -9998.99)
    set global.selector_sensor_2 = 4
  if (global.selector_sensor_2 == 0) && (global.selector_reading_2 > 9998.99 || global.selector_reading_2 == 9998.99) && (global.selector_reading_2 < 9999.01 || global.selector_reading_2 == 9999.01)
    set global.selector_sensor_2 = 4
  if (global.selector_sensor_2 == 0) && (global.selector_reading_2 > -999.001 || global.selector_reading_2 == -999.001) && (global.selector_reading_2 < -998.999 || global.selector_reading_2 == -998.999)
    set global.selector_sensor_2 = 4
  if (global.selector_sensor_2 == 0) && (global.selector_reading_2 > 32766.967 || global.selector_reading_2 == 32766.967) && (global.selector_reading_2 < 32767.033 || global.selector_reading_2 == 32767.033)
    set global.selector_sensor_2 = 4
  if (global.selector_sensor_2 == 0) && (global.selector_reading_2 > -32768.03 || global.selector_reading_2 == -32768.03) && (global.selector_reading_2 < -32767.967 || global.selector_reading_2 == -32767.967)
    set global.selector_sensor_2 = 4
  if (global.selector_sensor_2 == 0) && (global.selector_reading_2 > 3276.6968 || global.selector_reading_2 == 3276.6968) && (global.selector_reading_2 < 3276.7034 || global.selector_reading_2 == 3276.7034)
    set global.selector_sensor_2 = 4
  if (global.selector_sensor_2 == 0) && (global.selector_reading_2 > -3276.8032 || global.selector_reading_2 == -3276.8032) && (global.selector_reading_2 < -3276.7966 || global.selector_reading_2 == -3276.7966)
    set global.selector_sensor_2 = 4
  if global.selector_sensor_2 == 0
    set var.change = global.selector_reading_2 - global.selector_start_2
    if !(global.selector_has_start_2) && ((var.change > 10.0) || (var.change < -10.0))
      set global.selector_good_for_2 = -1.0
    if (global.selector_good_for_2 > 0.0 || global.selector_good_for_2 == 0.0)
      set var.credit_s = global.selector_since_sample_s
      if var.credit_s > 10.0
        set var.credit_s = 10.0
      set global.selector_good_for_2 = global.selector_good_for_2 + var.credit_s
      if global.selector_good_for_2 > 1e+06
        set global.selector_good_for_2 = 1e+06
    else
      set global.selector_good_for_2 = 0.0
      if !(global.selector_has_memory_2)
        if !(global.selector_has_start_2)
          set global.selector_start_2 = global.selector_reading_2
        set var.x = global.selector_reading_2 - global.selector_start_2
        set global.selector_x_2 = var.x
        if global.selector_x_2 < 0.0
          set global.selector_x_2 = 0.0
        if global.selector_x_2 > 10.0
          set global.selector_x_2 = 10.0
        set global.selector_since_2 = 0.0
    if global.selector_good_for_2 < 60.0
      set global.selector_sensor_2 = 2
    else
      set global.selector_has_start_2 = true
      set var.x = global.selector_reading_2 - global.selector_start_2
      set global.selector_x_2 = var.x
      if global.selector_x_2 < 0.0
        set global.selector_x_2 = 0.0
      if global.selector_x_2 > 10.0
        set global.selector_x_2 = 10.0
      if (var.x < -1e-08) || (var.x > 10.0)
        set global.selector_sensor_2 = 1
  else
    set global.selector_good_for_2 = -1.0
   ; memory: first-order lags of what is believed
  if (global.selector_sensor_1 == 0) || (global.selector_sensor_1 == 1)
    set global.selector_has_memory_1 = true
    set global.selector_is_new_1 = false
    set global.selector_since_1 = 0.0
  if (global.selector_sensor_2 == 0) || (global.selector_sensor_2 == 1)
    set global.selector_has_memory_2 = true
    set global.selector_is_new_2 = false
    set global.selector_since_2 = 0.0
   ; which model
  set global.selector_follows = 1
  if !(((global.selector_sensor_1 == 0) || (global.selector_sensor_1 == 1)) && ((global.selector_sensor_2 == 0) || (global.selector_sensor_2 == 1)))
    set global.selector_follows = 2
  if global.selector_follows == 2
    set global.selector_held_s = global.selector_held_s + global.selector_since_sample_s
    if global.selector_held_s > 1e+06
      set global.selector_held_s = 1e+06
  else
    set global.selector_held_s = 0.0
  if global.selector_follows == 3
    set global.selector_aim_1 = 0.0
    set global.selector_aim_2 = 0.0
  if global.selector_follows == 1
    set var.z_1 = (global.selector_x_1 - 0.0) / 1.0
    set var.z_2 = (global.selector_x_2 - 0.0) / 1.0
    set var.own = -1.871
    set var.own = var.own + 6.0476 * var.z_1
    set var.own = var.own + 2.6667 * var.z_2
    set var.own = (0.0 - var.own)
    if (var.own > -1e+09 || var.own == -1e+09) && (var.own < 1e+09 || var.own == 1e+09)
      if global.selector_zero_waits_1
        set global.selector_zero_waits_1 = false
        set global.selector_zero_1 = var.own
      set var.own = var.own - global.selector_zero_1
      if var.own < -90.0
        set var.own = -90.0
      if var.own > 90.0
        set var.own = 90.0
      set var.change = var.own - global.selector_aim_1
      if (var.change > 0.0 || var.change == 0.0) || (var.change < -0.0 || var.change == -0.0)
        set global.selector_aim_1 = var.own
    set var.own = 0.5703
    set var.own = var.own + 4.7292 * var.z_1
    set var.own = var.own + (-0.5908) * var.z_2
    set var.own = (0.0 - var.own)
    if (var.own > -1e+09 || var.own == -1e+09) && (var.own < 1e+09 || var.own == 1e+09)
      if global.selector_zero_waits_2
        set global.selector_zero_waits_2 = false
        set global.selector_zero_2 = var.own
      set var.own = var.own - global.selector_zero_2
      if var.own < -54.0
        set var.own = -54.0
      if var.own > 54.0
        set var.own = 54.0
      set var.change = var.own - global.selector_aim_2
      if (var.change > 0.0 || var.change == 0.0) || (var.change < -0.0 || var.change == -0.0)
        set global.selector_aim_2 = var.own
  set global.selector_is_first = false
  set global.selector_since_sample_s = 0.0
set global.selector_mode = global.selector_follows
if !(global.selector_is_wanted)
  set global.selector_mode = 4
 ; sign test: only after all were 0 while ready, and not for ever; else to zero
set var.is_test = false
set var.tested_1 = 0.0
if (global.selector_test_um_1 > -1e+09 || global.selector_test_um_1 == -1e+09) && (global.selector_test_um_1 < 1e+09 || global.selector_test_um_1 == 1e+09)
  set var.tested_1 = global.selector_test_um_1
if (var.tested_1 < 0.0) || (var.tested_1 > 0.0)
  set var.is_test = true
if var.tested_1 < -90.0
  set var.tested_1 = -90.0
if var.tested_1 > 90.0
  set var.tested_1 = 90.0
set var.tested_2 = 0.0
if (global.selector_test_um_2 > -1e+09 || global.selector_test_um_2 == -1e+09) && (global.selector_test_um_2 < 1e+09 || global.selector_test_um_2 == 1e+09)
  set var.tested_2 = global.selector_test_um_2
if (var.tested_2 < 0.0) || (var.tested_2 > 0.0)
  set var.is_test = true
if var.tested_2 < -54.0
  set var.tested_2 = -54.0
if var.tested_2 > 54.0
  set var.tested_2 = 54.0
if var.is_test
  set global.selector_mode = 4
  if global.selector_test_left_s > 0.0
    set global.selector_mode = 5
else
  set global.selector_test_left_s = 780.0
if !(global.selector_is_ready)
  set global.selector_mode = 0
  set global.selector_test_left_s = 0.0
set var.slewed_s = var.passed_s
if var.slewed_s > 10.0
  set var.slewed_s = 10.0
 ; correction of Z: no faster than the slew limit
if global.selector_mode == 0
  set global.selector_k0_1 = 0.0
  set global.selector_rest_1 = 0.0
  set global.selector_correction_1 = 0.0
else
  set var.towards = global.selector_aim_1
  if global.selector_mode == 4
    set var.towards = 0.0
  if global.selector_mode == 5
    set var.towards = var.tested_1
  set var.most = 1.0 * var.slewed_s + global.selector_rest_1
  set var.reach = var.most
  if var.reach < 0.0
    set var.reach = 0.0
  set var.low = global.selector_k0_1 - var.reach
  set var.high = global.selector_k0_1 + var.reach
  set global.selector_rest_1 = 0.0
  if var.towards < var.low
    set global.selector_rest_1 = var.most - (global.selector_k0_1 - var.low)
    set var.towards = var.low
  if var.towards > var.high
    set global.selector_rest_1 = var.most - (var.high - global.selector_k0_1)
    set var.towards = var.high
  set global.selector_k0_1 = var.towards
  set global.selector_correction_1 = global.selector_k0_1
 ; correction of Y: no faster than the slew limit
if global.selector_mode == 0
  set global.selector_k0_2 = 0.0
  set global.selector_rest_2 = 0.0
  set global.selector_correction_2 = 0.0
else
  set var.towards = global.selector_aim_2
  if global.selector_mode == 4
    set var.towards = 0.0
  if global.selector_mode == 5
    set var.towards = var.tested_2
  set var.most = 1.0 * var.slewed_s + global.selector_rest_2
  set var.reach = var.most
  if var.reach < 0.0
    set var.reach = 0.0
  set var.low = global.selector_k0_2 - var.reach
  set var.high = global.selector_k0_2 + var.reach
  set global.selector_rest_2 = 0.0
  if var.towards < var.low
    set global.selector_rest_2 = var.most - (global.selector_k0_2 - var.low)
    set var.towards = var.low
  if var.towards > var.high
    set global.selector_rest_2 = var.most - (var.high - global.selector_k0_2)
    set var.towards = var.high
  set global.selector_k0_2 = var.towards
  set global.selector_correction_2 = global.selector_k0_2
set global.selector_is_restart = false
 ; babysteps of Z: what others have moved since the last call stays, and
 ; M290 R0 Z0 clears everything
if var.is_zero_1
  set global.selector_is_zero_1 = false
var moved_1 = move.axes[2].babystep - global.selector_left_1
if var.moved_1 < -0.000001 || var.moved_1 > 0.000001
  set global.selector_left_1 = move.axes[2].babystep
  set global.selector_other_1 = global.selector_other_1 + var.moved_1
  if move.axes[2].babystep == 0.0
    set global.selector_other_1 = 0.0
    set global.selector_k0_1 = 0.0
    set global.selector_rest_1 = 0.0
    set global.selector_correction_1 = 0.0
    set global.selector_sent_1 = 0.0
if global.selector_correction_1 != global.selector_sent_1
  set global.selector_left_1 = global.selector_other_1 + global.selector_correction_1 / 1000.0
  M290 R0 Z{global.selector_left_1}
  set global.selector_sent_1 = global.selector_correction_1
 ; babysteps of Y: what others have moved since the last call stays, and
 ; M290 R0 Y0 clears everything
if var.is_zero_2
  set global.selector_is_zero_2 = false
var moved_2 = move.axes[1].babystep - global.selector_left_2
if var.moved_2 < -0.000001 || var.moved_2 > 0.000001
  set global.selector_left_2 = move.axes[1].babystep
  set global.selector_other_2 = global.selector_other_2 + var.moved_2
  if move.axes[1].babystep == 0.0
    set global.selector_other_2 = 0.0
    set global.selector_k0_2 = 0.0
    set global.selector_rest_2 = 0.0
    set global.selector_correction_2 = 0.0
    set global.selector_sent_2 = 0.0
if global.selector_correction_2 != global.selector_sent_2
  set global.selector_left_2 = global.selector_other_2 + global.selector_correction_2 / 1000.0
  M290 R0 Y{global.selector_left_2}
  set global.selector_sent_2 = global.selector_correction_2
if var.now - global.selector_saved_up >= 300
  set global.selector_saved_up = var.now
  var clock = 0
  if state.time != null
    set var.clock = +state.time
  echo >"selector_kept_a6dda75b.g" "set global.selector_saved_at = "^{var.clock}
  echo >>"selector_kept_a6dda75b.g" "set global.selector_is_restart = true"
  echo >>"selector_kept_a6dda75b.g" "set global.selector_start_1 = "^{global.selector_start_1 / 1}
  echo >>"selector_kept_a6dda75b.g" "set global.selector_start_2 = "^{global.selector_start_2 / 1}
  echo >>"selector_kept_a6dda75b.g" "set global.selector_has_memory_1 = "^{global.selector_has_memory_1}
  echo >>"selector_kept_a6dda75b.g" "set global.selector_has_start_1 = "^{global.selector_has_start_1}
  echo >>"selector_kept_a6dda75b.g" "set global.selector_has_memory_2 = "^{global.selector_has_memory_2}
  echo >>"selector_kept_a6dda75b.g" "set global.selector_has_start_2 = "^{global.selector_has_start_2}
