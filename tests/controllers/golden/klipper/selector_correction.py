# SIGN UNVERIFIED: do the sign test of the commissioning sheet before cutting.
# Model: patent CN1868666, two sensors
#   Z = -1.871 + 6.0476*dT1 + 2.6667*dT3 [um]
#   Y = 0.5703 + 4.7292*dT1 - 0.5908*dT3 [um]
# The correction of an axis is the negative of its displacement.
# Equations SHA-256 a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f
# Written by selector
# Python 2.7 and 3.
import logging
import math
import os
import time

PROGRAM = 'a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f'
MODEL = 'a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f'  # the same without signs
KEPT_FILE = 'selector_correction_kept.txt'
NO_READING = 1e+30
# name, unit
INPUTS = [
    ('T1', 'degC'),
    ('T3', 'degC'),
]
# number, axis (0: X), clamp [um], slew limit [um/s], of a slope: along which axis, from, to, zero [m]
OUTPUTS = [
    (1, 2, 90.0, 1.0, None),
    (2, 1, 54.0, 1.0, None),
]
# axes whose position the program needs
POSITIONS = [
]
# name in the program, whether it is a flag
RETAINED = [
    ('has_memory_1', True),
    ('start_1', False),
    ('has_start_1', True),
    ('has_memory_2', True),
    ('start_2', False),
    ('has_start_2', True),
]


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
        self.is_zero_1 = False  # the axis of Z was homed: its correction begins at zero there
        self.test_um_2 = 0.0  # sign test of Y: not 0 commands so much [um]
        self.is_zero_2 = False  # the axis of Y was homed: its correction begins at zero there
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
        self.zero_1 = 0.0  # correction that counts as none [um]
        self.zero_waits_1 = False  # it is taken with the next sample
        self.aim_2 = 0.0  # where it moves to [um]
        self.rest_2 = 0.0  # what rounding left of its last step [um]
        self.zero_2 = 0.0  # correction that counts as none [um]
        self.zero_waits_2 = False  # it is taken with the next sample
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
        if self.is_zero_1:
            self.k0_1 = 0.0
            self.rest_1 = 0.0
            self.correction_1 = 0.0
            self.aim_1 = 0.0
            self.zero_waits_1 = True
        if self.is_zero_2:
            self.k0_2 = 0.0
            self.rest_2 = 0.0
            self.correction_2 = 0.0
            self.aim_2 = 0.0
            self.zero_waits_2 = True
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
                    if self.zero_waits_1:
                        self.zero_waits_1 = False
                        self.zero_1 = own
                    own = own - self.zero_1
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
                    if self.zero_waits_2:
                        self.zero_waits_2 = False
                        self.zero_2 = own
                    own = own - self.zero_2
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


SAVE_EVERY = 300.
AXES = 'xyz'
STATES = {0: 'not homed, or shut down', 1: 'follows the model',
          2: 'holds', 3: 'ramps to zero', 4: 'switched off', 5: 'sign test'}
SENSOR_STATES = ('ok', 'beyond the range of the model', 'recovering',
                 'no reading', 'break code', 'out of limits', 'jumps',
                 'stands still', 'beyond the range of the model')


class PrinterCorrection:
    """Readings go into the program, its corrections into the moves."""

    def __init__(self, config):
        self.printer = config.get_printer()
        self.reactor = self.printer.get_reactor()
        self.gcode = self.printer.lookup_object('gcode')
        self.period = config.getfloat('period', 1., minval=.1, maxval=10.)
        self.stale_after = config.getfloat('stale_after', 30., minval=1.)
        self.zero_at_homing = config.getboolean('zero_at_homing', True)
        arguments = self.printer.get_start_args()
        folder = os.path.dirname(os.path.abspath(arguments['config_file']))
        self.kept_file = config.get('kept_file',
                                    os.path.join(folder, KEPT_FILE))
        # a test of a configuration never overwrites what a printer kept
        self.keeps = arguments.get('debugoutput') is None
        self.names, self.fields = [], []
        for k, (about, unit) in enumerate(INPUTS, 1):
            source = (config.get('sensor_%d' % k),
                      config.get('field_%d' % k, 'temperature')
                      if unit == 'degC' else config.get('field_%d' % k))
            if source in zip(self.names, self.fields):
                raise config.error(
                    "Option 'sensor_%d' in section '%s' names '%s' a second"
                    " time: every input of the model has a sensor of its own,"
                    " this one is %s"
                    % (k, config.get_name(), source[0], about))
            self.names.append(source[0])
            self.fields.append(source[1])
        self.program = ThermalCorrection()
        self.objects = []
        self.heard = {}  # number of the sensor: when it last spoke
        self.has_read = set()
        self.wanted = [(0., 0.) for one in OUTPUTS]  # k0 [um], slope [um/m]
        self.last_time = self.next_save = 0.
        self.homings = 0
        # [mm], X Y Z: where the last move ended in G-code, what is added
        # there, and what would be added without the ends of the axes
        self.last = [0., 0., 0.]
        self.applied = [0., 0., 0.]
        self.followed = [0., 0., 0.]
        self.gcode.register_command(
            'SELECTOR_CORRECTION', self.cmd_SELECTOR_CORRECTION,
            desc=self.cmd_SELECTOR_CORRECTION_help)
        # as early as this, so that a macro of that name is outside of it
        self.printer.load_object(config, 'homing')
        self.real_G28 = self.gcode.register_command('G28', None)
        self.gcode.register_command('G28', self.cmd_G28)
        for event, handler in (('connect', self._connect),
                               ('ready', self._ready),
                               ('disconnect', self._save)):
            self.printer.register_event_handler('klippy:' + event, handler)

    # Start

    def _connect(self):
        self.toolhead = self.printer.lookup_object('toolhead')
        self.gcode_move = self.printer.lookup_object('gcode_move')
        other = self.printer.lookup_object('z_thermal_adjust', None)
        if other is not None and 2 in [one[1] for one in OUTPUTS]:
            raise self.printer.config_error(
                "selector_correction and z_thermal_adjust both correct Z:"
                " take one of the two sections out")
        for k, name in enumerate(self.names):
            self.objects.append(self._found(k, name))
            self._watch(k, self.objects[k])
        self.next_transform = self.gcode_move.set_move_transform(
            self, force=True)

    def _found(self, k, name):
        found = self.printer.lookup_object(name, None)
        status = {}
        if hasattr(found, 'get_status'):
            status = found.get_status(self.reactor.monotonic())
        if self.fields[k] not in status:
            heaters = self.printer.lookup_object('heaters', None)
            known = getattr(heaters, 'available_sensors', [])
            raise self.printer.config_error(
                "selector_correction: sensor_%d (%s) is '%s', which %s."
                " Temperatures are in: %s"
                % (k + 1, INPUTS[k][0], name, "is not in the configuration"
                   if found is None else "has no '%s'" % (self.fields[k],),
                   ", ".join(known) or "no section"))
        return found

    def _watch(self, k, found):
        """Notes when a sensor speaks: a status alone never grows old."""
        holder = getattr(found, 'heater', found)
        sensor = getattr(holder, 'sensor', None)
        callback = getattr(holder, 'temperature_callback', None)
        if (self.fields[k] != 'temperature' or sensor is holder
            or callback is None or not hasattr(sensor, 'setup_callback')):
            logging.info("selector_correction: it is not seen when sensor_%d"
                         " (%s) no longer reports", k + 1, self.names[k])
            return
        self.heard[k] = None

        def heard(read_time, temperature):
            self.heard[k] = self.reactor.monotonic()
            callback(read_time, temperature)
        sensor.setup_callback(heard)

    def _ready(self):
        if self.keeps:
            self._restore()
        self.last_time = self.reactor.monotonic()
        self.next_save = self.last_time + SAVE_EVERY
        self.reactor.register_timer(self._tick, self.last_time + self.period)

    # The program

    def _tick(self, eventtime):
        self._step(eventtime)
        if eventtime >= self.next_save:
            self._save()
            self.next_save = eventtime + SAVE_EVERY
        return eventtime + self.period

    def _step(self, eventtime):
        program = self.program
        program.dt_s = eventtime - self.last_time
        self.last_time = eventtime
        for k in range(len(INPUTS)):
            setattr(program, 'reading_%d' % (k + 1,),
                    self._reading(k, eventtime))
        for k, axis in enumerate(POSITIONS, 1):
            setattr(program, 'position_%d' % k, self.last[axis] / 1000.)
        homed = self._limits()['homed_axes']
        program.is_ready = (not self.printer.is_shutdown() and not
                            [one for one in OUTPUTS if AXES[one[1]] not in homed])
        program.step()
        for n, (k, axis, clamp, slew, along) in enumerate(OUTPUTS):
            setattr(program, 'is_zero_%d' % k, False)
            self.wanted[n] = (getattr(program, 'k0_%d' % k),
                              getattr(program, 'slope_%d' % k, 0.))

    def _reading(self, k, eventtime):
        value = self.objects[k].get_status(eventtime).get(self.fields[k])
        try:
            value = float(value)
        except (TypeError, ValueError):
            return NO_READING
        if k in self.heard:
            heard = self.heard[k]
            if heard is None or eventtime - heard > self.stale_after:
                return NO_READING
        elif value:
            self.has_read.add(k)
        elif k not in self.has_read:
            return NO_READING  # Klipper's 0.0 of what was never read
        return value

    def _limits(self):
        kinematics = self.toolhead.get_kinematics()
        return kinematics.get_status(self.reactor.monotonic())

    # Moves

    def _wanted(self, output, at):
        """What the program wants to have added at a place [mm]."""
        k, axis, clamp, slew, along = output
        wanted, slope = self.wanted[k - 1]
        if along is not None:
            of, low, high, reference = along
            where = max(low, min(high, at[of] / 1000.))
            wanted += slope * (where - reference)
        return max(-clamp, min(clamp, wanted)) / 1000.

    def get_position(self):
        position = list(self.next_transform.get_position())
        for axis in range(3):
            position[axis] -= self.applied[axis]
        self.last = position[:3]
        return position

    def move(self, newpos, speed):
        distance = math.sqrt(sum([(to - of) ** 2 for to, of in
                                  zip(newpos[:3], self.last)]))
        followed, applied = self.followed, self.applied
        # a move of the extruder alone stays one
        if distance > 1e-9:
            followed, applied = self._added(newpos, distance / speed)
        self._send(newpos, speed, followed, applied)

    def _added(self, newpos, seconds):
        """Each axis comes closer to what is wanted, at its slew limit."""
        followed, applied = list(self.followed), list(self.applied)
        limits = self._limits()
        for output in OUTPUTS:
            k, axis, clamp, slew, along = output
            if AXES[axis] not in limits['homed_axes']:
                continue
            behind = followed[axis] - self._wanted(output, self.last)
            most = slew / 1000. * seconds
            behind -= max(-most, min(most, behind))
            added = self._wanted(output, newpos) + behind
            added = max(-clamp / 1000., min(clamp / 1000., added))
            followed[axis] = added
            low, high = limits['axis_minimum'][axis], limits['axis_maximum'][axis]
            if low <= newpos[axis] <= high:
                added = max(low - newpos[axis], min(high - newpos[axis], added))
            applied[axis] = added
        return followed, applied

    def _send(self, newpos, speed, followed, applied):
        sent = list(newpos)
        for axis in range(3):
            sent[axis] += applied[axis]
        self.next_transform.move(sent, speed)
        # a move that was refused has changed nothing
        self.followed, self.applied = followed, applied
        self.last = list(newpos[:3])

    # Homing

    def cmd_G28(self, gcmd):
        homings = self.homings = self.homings + 1
        self.real_G28(gcmd)
        if self.homings != homings:
            return  # homing_override: the G28 inside of it have told all
        asked = [a for a in range(3) if gcmd.get('XYZ'[a], None) is not None]
        homed = self._limits()['homed_axes']
        for k, axis, clamp, slew, along in OUTPUTS:
            if (self.zero_at_homing and AXES[axis] in homed
                and (axis in asked or not asked)):
                setattr(self.program, 'is_zero_%d' % k, True)
                self.followed[axis] = self.applied[axis] = 0.
        self.gcode_move.reset_last_position()
        self._step(self.reactor.monotonic())

    # What is kept while Klipper is off

    def _save(self):
        if not self.keeps:
            return
        lines = ['model ' + MODEL, 'saved-at %d' % (time.time(),)]
        lines += ['%s %r' % (name, float(getattr(self.program, name)))
                  for name, is_flag in RETAINED]
        try:
            with open(self.kept_file + '.new', 'w') as new:
                new.write('\n'.join(lines) + '\n')
            os.rename(self.kept_file + '.new', self.kept_file)
        except (IOError, OSError):
            logging.exception("selector_correction: %s cannot be written;"
                              " start readings are lost at a restart",
                              self.kept_file)

    def _restore(self):
        try:
            with open(self.kept_file) as old:
                kept = dict([line.split() for line in old])
            if kept['model'] != MODEL:
                logging.warning("selector_correction: %s is of another model;"
                                " start readings are taken anew",
                                self.kept_file)
                return
            off = time.time() - float(kept['saved-at'])
            if off < 0.:
                # a clock that was put back says nothing
                off = 1e6
            values = [float(kept[name]) for name, is_flag in RETAINED]
        except (IOError, OSError):
            return  # the first start
        except (ValueError, KeyError):
            logging.exception("selector_correction: %s is damaged; start"
                              " readings are taken anew", self.kept_file)
            return
        for (name, is_flag), value in zip(RETAINED, values):
            setattr(self.program, name, value == 1. if is_flag else value)
        self.program.is_restart = True
        self.program.standstill_s = off

    # What is asked and told

    cmd_SELECTOR_CORRECTION_help = (
        "Thermal correction: ENABLE=0|1, TEST_<axis>=<um> for the sign test,"
        " MOVE=1 to move by what is not yet applied, NEW_START=1 for new start"
        " readings; without parameters, what it does")

    def cmd_SELECTOR_CORRECTION(self, gcmd):
        program = self.program
        enable = gcmd.get_int('ENABLE', None, minval=0, maxval=1)
        new_start = gcmd.get_int('NEW_START', 0, minval=0, maxval=1)
        for k, axis, clamp, slew, along in OUTPUTS:
            test = gcmd.get_float('TEST_' + 'XYZ'[axis], None)
            if test is not None:
                setattr(program, 'test_um_%d' % k, test)
        if enable is not None:
            program.is_wanted = bool(enable)
        if new_start:
            for name, is_flag in RETAINED:
                if is_flag:
                    setattr(program, name, False)
            for k in range(1, len(INPUTS) + 1):
                setattr(program, 'good_for_%d' % k, -1.)
            for k, axis, clamp, slew, along in OUTPUTS:
                # what counted as none was said from the old start
                setattr(program, 'is_zero_%d' % k, self.zero_at_homing)
        if gcmd.get_int('MOVE', 0, minval=0, maxval=1):
            self._move_now(gcmd)
        gcmd.respond_info(self._told())

    def _move_now(self, gcmd):
        """A move of the correction alone, at its slew limit."""
        homed, newpos = self._limits()['homed_axes'], self.get_position()
        seconds = 0.
        for output in OUTPUTS:
            k, axis, clamp, slew, along = output
            if AXES[axis] not in homed:
                raise gcmd.error("selector_correction: axis %s is not homed;"
                                 " G28 first" % ('XYZ'[axis],))
            left = self._wanted(output, newpos) - self.followed[axis]
            seconds = max(seconds, abs(left) / (slew / 1000.))
        followed, applied = self._added(newpos, 1.001 * seconds)
        distance = math.sqrt(sum([(to - of) ** 2 for to, of in
                                  zip(applied, self.applied)]))
        if distance > 1e-9:
            self._send(newpos, distance / seconds, followed, applied)
            self.toolhead.wait_moves()

    def _told(self):
        status = self.get_status(self.reactor.monotonic())
        lines = ["Thermal correction %s: ENABLE=%d, mode %d, %s"
                 % (PROGRAM[:16], status['enabled'], status['mode'],
                    status['state'])]
        for letter in sorted(status['wanted_um']):
            lines.append("%s: %+.1f um wanted, %+.1f um applied"
                         % (letter, status['wanted_um'][letter],
                            status['applied_um'][letter]))
        for k, (name, code) in enumerate(zip(self.names,
                                             status['sensors'])):
            reading = getattr(self.program, 'reading_%d' % (k + 1,))
            shown = '-' if reading == NO_READING else '%.2f' % (reading,)
            lines.append("sensor_%d (%s): %s, %s" % (
                k + 1, name, shown, SENSOR_STATES[code]))
        return "\n".join(lines)

    def get_status(self, eventtime):
        program, mode = self.program, self.program.mode
        state = STATES.get(mode) or 'follows fallback %d' % (mode - 9,)
        wanted = [(AXES[one[1]], 1000. * self._wanted(one, self.last))
                  for one in OUTPUTS]
        return {
            'enabled': program.is_wanted,
            'mode': mode,
            'state': state,
            'wanted_um': dict([(a, round(um, 2)) for a, um in wanted]),
            'applied_um': dict([(AXES[one[1]],
                                 round(1000. * self.applied[one[1]], 2))
                                for one in OUTPUTS]),
            'sensors': [getattr(program, 'sensor_%d' % k)
                        for k in range(1, len(INPUTS) + 1)],
        }

    def stats(self, eventtime):
        told = ['mode=%d' % (self.program.mode,)]
        told += ['%s=%.1f' % (AXES[one[1]], 1000. * self.applied[one[1]])
                 for one in OUTPUTS]
        return False, 'selector_correction: ' + ' '.join(told)


def load_config(config):
    return PrinterCorrection(config)
