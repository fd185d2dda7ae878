# SIGN UNVERIFIED: do the sign test of the commissioning sheet before cutting.
# Model: patent CN1868666, two sensors
#   Z = -1.871 + 6.0476*dT1 + 2.6667*dT3 [um]
#   Y = 0.5703 + 4.7292*dT1 - 0.5908*dT3 [um]
# The correction of an axis is the negative of its displacement.
# Equations SHA-256 a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f
# Written by selector


class ThermalCorrection:
    """Set the inputs, call step() every cycle, read the outputs."""

    def __init__(self):
        # inputs
        self.dt_s = 0.0  # time since the last call [s]
        self.reading_1 = 1e+30  # T1 [degC]
        self.reading_2 = 1e+30  # T3 [degC]
        self.is_ready = True  # drives on and axis referenced
        self.is_wanted = True  # the operator's switch
        self.is_restart = False  # true in the first call after the control was off
        self.standstill_s = 0.0  # with is_restart: off for so long [s]
        self.test_um_1 = 0.0  # sign test of Z: not 0 commands so much [um]
        self.test_um_2 = 0.0  # sign test of Y: not 0 commands so much [um]
        # outputs
        self.sensor_1 = 3  # T1: 0 ok, 1 limited, 2 recovering, 3 missing, 4 break code, 5 out of limits, 6 jump, 7 stuck, 8 range
        self.sensor_2 = 3  # T3
        self.correction_1 = 0.0  # to be added to the axis for Z [um]
        self.k0_1 = 0.0  # the same at the reference position [um]
        self.correction_2 = 0.0  # to be added to the axis for Y [um]
        self.k0_2 = 0.0  # the same at the reference position [um]
        self.mode = 0  # 0 off, 1 model, 2 hold, 3 ramp to zero, 4 switched off, 5 sign test, 10 and more: fallback
        # to be kept when the control is off
        self.has_memory_1 = False  # memory has begun
        self.start_1 = 0.0  # start reading of T1
        self.has_start_1 = False  # start reading is taken
        self.has_memory_2 = False  # memory has begun
        self.start_2 = 0.0  # start reading of T3
        self.has_start_2 = False  # start reading is taken
        # state
        self.x_1 = 0.0  # T1 as the model gets it
        self.since_1 = 0.0  # since it was believed last [s]
        self.good_for_1 = -1.0  # good for so long [s]; -1: not good
        self.is_new_1 = True  # not believed since the control started
        self.x_2 = 0.0  # T3 as the model gets it
        self.since_2 = 0.0  # since it was believed last [s]
        self.good_for_2 = -1.0  # good for so long [s]; -1: not good
        self.is_new_2 = True  # not believed since the control started
        self.aim_1 = 0.0  # where it moves to [um]
        self.rest_1 = 0.0  # what rounding left of its last step [um]
        self.aim_2 = 0.0  # where it moves to [um]
        self.rest_2 = 0.0  # what rounding left of its last step [um]
        self.was_restart = False  # is_restart in the call before
        self.is_first = True  # no sample yet
        self.since_sample_s = 0.0  # since the last sample [s]
        self.held_s = 0.0  # held for so long [s]
        self.test_left_s = 0.0  # a sign test may go on for so long [s]
        self.follows = 2  # as mode, while ready and wanted

    def step(self):
        if self.is_restart and not (self.was_restart):
            # the control was off: memory goes on, the correction begins at zero
            off_s = 0.0
            if self.standstill_s > 0.0:
                off_s = self.standstill_s
            if off_s > 1000000.0:
                off_s = 1000000.0
            self.since_1 = self.since_1 + off_s
            if self.since_1 > 1000000.0:
                self.since_1 = 1000000.0
            self.good_for_1 = -1.0
            self.is_new_1 = True
            self.since_2 = self.since_2 + off_s
            if self.since_2 > 1000000.0:
                self.since_2 = 1000000.0
            self.good_for_2 = -1.0
            self.is_new_2 = True
            self.is_first = True
            self.since_sample_s = 0.0
            self.held_s = 0.0
            self.test_left_s = 0.0
            self.follows = 2
            self.k0_1 = 0.0
            self.rest_1 = 0.0
            self.correction_1 = 0.0
            self.aim_1 = 0.0
            self.k0_2 = 0.0
            self.rest_2 = 0.0
            self.correction_2 = 0.0
            self.aim_2 = 0.0
        self.was_restart = self.is_restart
        if self.is_first:
            # what was kept is dropped where it cannot be
            if not ((self.start_1 >= -1000000000.0) and (self.start_1 <= 1000000000.0)):
                self.has_memory_1 = False
                self.has_start_1 = False
            if not ((self.start_2 >= -1000000000.0) and (self.start_2 <= 1000000000.0)):
                self.has_memory_2 = False
                self.has_start_2 = False
        # time: what is no time, or too long, counts as 0
        passed_s = 0.0
        if (self.dt_s > 0.0) and (self.dt_s <= 1000000.0):
            passed_s = self.dt_s
        self.since_sample_s = self.since_sample_s + passed_s
        if self.since_sample_s > 1000000.0:
            self.since_sample_s = 1000000.0
        if self.is_first or (self.since_sample_s >= 1.0):
            if self.mode == 5:
                self.test_left_s = self.test_left_s - self.since_sample_s
                if self.test_left_s < 0.0:
                    self.test_left_s = 0.0
            # sensor T1
            if (not (self.has_memory_1) or not (self.has_start_1)) and not (self.is_new_1):
                self.has_memory_1 = False
                self.is_new_1 = True
                self.good_for_1 = -1.0
            self.since_1 = self.since_1 + self.since_sample_s
            if self.since_1 > 1000000.0:
                self.since_1 = 1000000.0
            self.sensor_1 = 0
            if not ((self.reading_1 >= -1000000000.0) and (self.reading_1 <= 1000000000.0)):
                self.sensor_1 = 3
            if (self.sensor_1 == 0) and (self.reading_1 >= 849.99915) and (self.reading_1 <= 850.00085):
                self.sensor_1 = 4
            if (self.sensor_1 == 0) and (self.reading_1 >= -9999.009999) and (self.reading_1 <= -9998.990001):
                self.sensor_1 = 4
            if (self.sensor_1 == 0) and (self.reading_1 >= 9998.990001) and (self.reading_1 <= 9999.009999):
                self.sensor_1 = 4
            if (self.sensor_1 == 0) and (self.reading_1 >= -999.000999) and (self.reading_1 <= -998.999001):
                self.sensor_1 = 4
            if (self.sensor_1 == 0) and (self.reading_1 >= 32766.967233) and (self.reading_1 <= 32767.032767):
                self.sensor_1 = 4
            if (self.sensor_1 == 0) and (self.reading_1 >= -32768.032768) and (self.reading_1 <= -32767.967232):
                self.sensor_1 = 4
            if (self.sensor_1 == 0) and (self.reading_1 >= 3276.6967233) and (self.reading_1 <= 3276.7032766999996):
                self.sensor_1 = 4
            if (self.sensor_1 == 0) and (self.reading_1 >= -3276.8032768000003) and (self.reading_1 <= -3276.7967232):
                self.sensor_1 = 4
            if self.sensor_1 == 0:
                change = self.reading_1 - self.start_1
                if not (self.has_start_1) and ((change > 10.0) or (change < -10.0)):
                    self.good_for_1 = -1.0
                if self.good_for_1 >= 0.0:
                    credit_s = self.since_sample_s
                    if credit_s > 10.0:
                        credit_s = 10.0
                    self.good_for_1 = self.good_for_1 + credit_s
                    if self.good_for_1 > 1000000.0:
                        self.good_for_1 = 1000000.0
                else:
                    self.good_for_1 = 0.0
                    if not (self.has_memory_1):
                        if not (self.has_start_1):
                            self.start_1 = self.reading_1
                        x = self.reading_1 - self.start_1
                        self.x_1 = x
                        if self.x_1 < 0.0:
                            self.x_1 = 0.0
                        if self.x_1 > 10.0:
                            self.x_1 = 10.0
                        self.since_1 = 0.0
                if self.good_for_1 < 60.0:
                    self.sensor_1 = 2
                else:
                    self.has_start_1 = True
                    x = self.reading_1 - self.start_1
                    self.x_1 = x
                    if self.x_1 < 0.0:
                        self.x_1 = 0.0
                    if self.x_1 > 10.0:
                        self.x_1 = 10.0
                    if (x < -1e-08) or (x > 10.00000001):
                        self.sensor_1 = 1
            else:
                self.good_for_1 = -1.0
            # sensor T3
            if (not (self.has_memory_2) or not (self.has_start_2)) and not (self.is_new_2):
                self.has_memory_2 = False
                self.is_new_2 = True
                self.good_for_2 = -1.0
            self.since_2 = self.since_2 + self.since_sample_s
            if self.since_2 > 1000000.0:
                self.since_2 = 1000000.0
            self.sensor_2 = 0
            if not ((self.reading_2 >= -1000000000.0) and (self.reading_2 <= 1000000000.0)):
                self.sensor_2 = 3
            if (self.sensor_2 == 0) and (self.reading_2 >= 849.99915) and (self.reading_2 <= 850.00085):
                self.sensor_2 = 4
            if (self.sensor_2 == 0) and (self.reading_2 >= -9999.009999) and (self.reading_2 <= -9998.990001):
                self.sensor_2 = 4
            if (self.sensor_2 == 0) and (self.reading_2 >= 9998.990001) and (self.reading_2 <= 9999.009999):
                self.sensor_2 = 4
            if (self.sensor_2 == 0) and (self.reading_2 >= -999.000999) and (self.reading_2 <= -998.999001):
                self.sensor_2 = 4
            if (self.sensor_2 == 0) and (self.reading_2 >= 32766.967233) and (self.reading_2 <= 32767.032767):
                self.sensor_2 = 4
            if (self.sensor_2 == 0) and (self.reading_2 >= -32768.032768) and (self.reading_2 <= -32767.967232):
                self.sensor_2 = 4
            if (self.sensor_2 == 0) and (self.reading_2 >= 3276.6967233) and (self.reading_2 <= 3276.7032766999996):
                self.sensor_2 = 4
            if (self.sensor_2 == 0) and (self.reading_2 >= -3276.8032768000003) and (self.reading_2 <= -3276.7967232):
                self.sensor_2 = 4
            if self.sensor_2 == 0:
                change = self.reading_2 - self.start_2
                if not (self.has_start_2) and ((change > 10.0) or (change < -10.0)):
                    self.good_for_2 = -1.0
                if self.good_for_2 >= 0.0:
                    credit_s = self.since_sample_s
                    if credit_s > 10.0:
                        credit_s = 10.0
                    self.good_for_2 = self.good_for_2 + credit_s
                    if self.good_for_2 > 1000000.0:
                        self.good_for_2 = 1000000.0
                else:
                    self.good_for_2 = 0.0
                    if not (self.has_memory_2):
                        if not (self.has_start_2):
                            self.start_2 = self.reading_2
                        x = self.reading_2 - self.start_2
                        self.x_2 = x
                        if self.x_2 < 0.0:
                            self.x_2 = 0.0
                        if self.x_2 > 10.0:
                            self.x_2 = 10.0
                        self.since_2 = 0.0
                if self.good_for_2 < 60.0:
                    self.sensor_2 = 2
                else:
                    self.has_start_2 = True
                    x = self.reading_2 - self.start_2
                    self.x_2 = x
                    if self.x_2 < 0.0:
                        self.x_2 = 0.0
                    if self.x_2 > 10.0:
                        self.x_2 = 10.0
                    if (x < -1e-08) or (x > 10.00000001):
                        self.sensor_2 = 1
            else:
                self.good_for_2 = -1.0
            # memory: first-order lags of what is believed
            if (self.sensor_1 == 0) or (self.sensor_1 == 1):
                self.has_memory_1 = True
                self.is_new_1 = False
                self.since_1 = 0.0
            if (self.sensor_2 == 0) or (self.sensor_2 == 1):
                self.has_memory_2 = True
                self.is_new_2 = False
                self.since_2 = 0.0
            # which model
            self.follows = 1
            if not (((self.sensor_1 == 0) or (self.sensor_1 == 1)) and ((self.sensor_2 == 0) or (self.sensor_2 == 1))):
                self.follows = 2
            if self.follows == 2:
                self.held_s = self.held_s + self.since_sample_s
                if self.held_s > 1000000.0:
                    self.held_s = 1000000.0
            else:
                self.held_s = 0.0
            if self.follows == 3:
                self.aim_1 = 0.0
                self.aim_2 = 0.0
            if self.follows == 1:
                z_1 = (self.x_1 - 0.0) / 1.0
                z_2 = (self.x_2 - 0.0) / 1.0
                own = -1.871
                own = own + 6.0476 * z_1
                own = own + 2.6667 * z_2
                own = -own
                if (own >= -1000000000.0) and (own <= 1000000000.0):
                    if own < -90.0:
                        own = -90.0
                    if own > 90.0:
                        own = 90.0
                    change = own - self.aim_1
                    if (change >= 0.0) or (change <= -0.0):
                        self.aim_1 = own
                own = 0.5703
                own = own + 4.7292 * z_1
                own = own + (-0.5908) * z_2
                own = -own
                if (own >= -1000000000.0) and (own <= 1000000000.0):
                    if own < -54.0:
                        own = -54.0
                    if own > 54.0:
                        own = 54.0
                    change = own - self.aim_2
                    if (change >= 0.0) or (change <= -0.0):
                        self.aim_2 = own
            self.is_first = False
            self.since_sample_s = 0.0
        self.mode = self.follows
        if not (self.is_wanted):
            self.mode = 4
        # sign test: only after all were 0 while ready, and not for ever; else to zero
        is_test = False
        tested_1 = 0.0
        if (self.test_um_1 >= -1000000000.0) and (self.test_um_1 <= 1000000000.0):
            tested_1 = self.test_um_1
        if (tested_1 < 0.0) or (tested_1 > 0.0):
            is_test = True
        if tested_1 < -90.0:
            tested_1 = -90.0
        if tested_1 > 90.0:
            tested_1 = 90.0
        tested_2 = 0.0
        if (self.test_um_2 >= -1000000000.0) and (self.test_um_2 <= 1000000000.0):
            tested_2 = self.test_um_2
        if (tested_2 < 0.0) or (tested_2 > 0.0):
            is_test = True
        if tested_2 < -54.0:
            tested_2 = -54.0
        if tested_2 > 54.0:
            tested_2 = 54.0
        if is_test:
            self.mode = 4
            if self.test_left_s > 0.0:
                self.mode = 5
        else:
            self.test_left_s = 780.0
        if not (self.is_ready):
            self.mode = 0
            self.test_left_s = 0.0
        slewed_s = passed_s
        if slewed_s > 10.0:
            slewed_s = 10.0
        # correction of Z: no faster than the slew limit
        if self.mode == 0:
            self.k0_1 = 0.0
            self.rest_1 = 0.0
            self.correction_1 = 0.0
        else:
            towards = self.aim_1
            if self.mode == 4:
                towards = 0.0
            if self.mode == 5:
                towards = tested_1
            most = 1.0 * slewed_s + self.rest_1
            reach = most
            if reach < 0.0:
                reach = 0.0
            low = self.k0_1 - reach
            high = self.k0_1 + reach
            self.rest_1 = 0.0
            if towards < low:
                self.rest_1 = most - (self.k0_1 - low)
                towards = low
            if towards > high:
                self.rest_1 = most - (high - self.k0_1)
                towards = high
            self.k0_1 = towards
            self.correction_1 = self.k0_1
        # correction of Y: no faster than the slew limit
        if self.mode == 0:
            self.k0_2 = 0.0
            self.rest_2 = 0.0
            self.correction_2 = 0.0
        else:
            towards = self.aim_2
            if self.mode == 4:
                towards = 0.0
            if self.mode == 5:
                towards = tested_2
            most = 1.0 * slewed_s + self.rest_2
            reach = most
            if reach < 0.0:
                reach = 0.0
            low = self.k0_2 - reach
            high = self.k0_2 + reach
            self.rest_2 = 0.0
            if towards < low:
                self.rest_2 = most - (self.k0_2 - low)
                towards = low
            if towards > high:
                self.rest_2 = most - (high - self.k0_2)
                towards = high
            self.k0_2 = towards
            self.correction_2 = self.k0_2
