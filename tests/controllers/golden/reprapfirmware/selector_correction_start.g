 ; SIGN UNVERIFIED: do the sign test of the commissioning sheet before cutting.
 ; Model: patent CN1868666, two sensors
 ;   Z = -1.871 + 6.0476*dT1 + 2.6667*dT3 [um]
 ;   Y = 0.5703 + 4.7292*dT1 - 0.5908*dT3 [um]
 ; The correction of an axis is the negative of its displacement.
 ; Equations SHA-256 a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f
 ; Written by selector
 ; Single precision: largest difference to the float64 model inside the valid ranges: Z 0.00013 um, Y 7.8e-05 um,
 ;   for readings up to T1 70 degC, T3 70 degC, called at most 100 times a second.
 ; The last line of config.g: M98 P"selector_correction_start.g"
if exists(global.selector_is_started)
  echo "selector: its variables are there already. After a change here restart. Of two models export one with all outputs"
if !exists(global.selector_is_started)
  global selector_is_started = false
  global selector_is_running = true
  global selector_called_at = state.upTime
  global selector_saved_at = 0
  global selector_saved_up = state.upTime
 ; >>>> The number of each thermometer, as in M308 S3 ...; -1: none yet
  global selector_number_1 = -1 ; T1 [degC]
  global selector_number_2 = -1 ; T3 [degC]
  global selector_sent_1 = 0.0 ; correction that is in the babysteps of Z [um]
  global selector_left_1 = 0.0 ; babysteps of Z after the last call [mm]
  global selector_other_1 = 0.0 ; what of them is of others [mm]
  global selector_sent_2 = 0.0 ; correction that is in the babysteps of Y [um]
  global selector_left_2 = 0.0 ; babysteps of Y after the last call [mm]
  global selector_other_2 = 0.0 ; what of them is of others [mm]
 ; inputs, outputs and what is kept from call to call
  global selector_dt_s = 0.0 ; time since the last call [s]
  global selector_reading_1 = 1e+30 ; T1 [degC]
  global selector_sensor_1 = 3 ; T1: 0 ok, 1 limited, 2 recovering, 3 missing, 4 break code, 5 out of limits, 6 jump, 7 stuck, 8 range
  global selector_x_1 = 0.0 ; T1 as the model gets it
  global selector_since_1 = 0.0 ; since it was believed last [s]
  global selector_good_for_1 = -1.0 ; good for so long [s]; -1: not good
  global selector_is_new_1 = true ; not believed since the control started
  global selector_has_memory_1 = false ; memory has begun
  global selector_start_1 = 0.0 ; start reading of T1
  global selector_has_start_1 = false ; start reading is taken
  global selector_reading_2 = 1e+30 ; T3 [degC]
  global selector_sensor_2 = 3 ; T3
  global selector_x_2 = 0.0 ; T3 as the model gets it
  global selector_since_2 = 0.0 ; since it was believed last [s]
  global selector_good_for_2 = -1.0 ; good for so long [s]; -1: not good
  global selector_is_new_2 = true ; not believed since the control started
  global selector_has_memory_2 = false ; memory has begun
  global selector_start_2 = 0.0 ; start reading of T3
  global selector_has_start_2 = false ; start reading is taken
  global selector_is_ready = true ; drives on and axis referenced
  global selector_is_wanted = true ; the operator's switch
  global selector_is_restart = false ; true in the first call after the control was off
  global selector_standstill_s = 0.0 ; with is_restart: off for so long [s]
  global selector_test_um_1 = 0.0 ; sign test of Z: not 0 commands so much [um]
  global selector_correction_1 = 0.0 ; to be added to the axis for Z [um]
  global selector_k0_1 = 0.0 ; the same at the reference position [um]
  global selector_aim_1 = 0.0 ; where it moves to [um]
  global selector_rest_1 = 0.0 ; what rounding left of its last step [um]
  global selector_is_zero_1 = false ; the axis of Z was homed: its correction begins at zero there
  global selector_zero_1 = 0.0 ; correction that counts as none [um]
  global selector_zero_waits_1 = false ; it is taken with the next sample
  global selector_test_um_2 = 0.0 ; sign test of Y: not 0 commands so much [um]
  global selector_correction_2 = 0.0 ; to be added to the axis for Y [um]
  global selector_k0_2 = 0.0 ; the same at the reference position [um]
  global selector_aim_2 = 0.0 ; where it moves to [um]
  global selector_rest_2 = 0.0 ; what rounding left of its last step [um]
  global selector_is_zero_2 = false ; the axis of Y was homed: its correction begins at zero there
  global selector_zero_2 = 0.0 ; correction that counts as none [um]
  global selector_zero_waits_2 = false ; it is taken with the next sample
  global selector_mode = 0 ; 0 off, 1 model, 2 hold, 3 ramp to zero, 4 switched off, 5 sign test, 10 and more: fallback
  global selector_was_restart = false ; is_restart in the call before
  global selector_is_first = true ; no sample yet
  global selector_since_sample_s = 0.0 ; since the last sample [s]
  global selector_held_s = 0.0 ; held for so long [s]
  global selector_test_left_s = 0.0 ; a sign test may go on for so long [s]
  global selector_follows = 2 ; as mode, while ready and wanted
