/*
 * SIGN UNVERIFIED: do the sign test of the commissioning sheet before cutting.
 * Model: patent CN1868666, two sensors
 *   Z = -1.871 + 6.0476*dT1 + 2.6667*dT3 [um]
 *   Y = 0.5703 + 4.7292*dT1 - 0.5908*dT3 [um]
 * The correction of an axis is the negative of its displacement.
 * Equations SHA-256 a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f
 * Written by selector
 * Install: sudo halcompile --install thermcorr.comp
 */
component thermcorr "Thermal correction of axes, by axis.L.eoffset-counts";
pin in float dt = 0.0 "time since the last call [s]; 0: the period of the thread";
pin in bit is_enabled = 0 "wire motion.motion-enabled";
pin in bit is_homed = 0 "wire motion.is-all-homed";
pin in bit is_wanted = 1 "the operator's switch; false ramps the correction to zero";
pin in s32 restart = 0 "every change of this number: the control was off for standstill seconds";
pin in float standstill = 0.0 "[s]";
pin in bit new_start = 0 "while true, start readings and memory are taken anew";
pin in float reading_1 = 1e+30 "T1 [degC]";
pin in float reading_2 = 1e+30 "T3 [degC]";
pin in float test_um_1 = 0.0 "sign test of Z: not 0 commands so much [um]";
pin in float test_um_2 = 0.0 "sign test of Y: not 0 commands so much [um]";
pin out s32 sensor_1 "T1: 0 ok, 1 limited, 2 recovering, 3 missing, 4 break code, 5 out of limits, 6 jump, 7 stuck, 8 range";
pin out s32 sensor_2 "T3";
pin out float correction_1 "to be added to the axis for Z [um]";
pin out float k0_1 "the same at the reference position [um]";
pin out float correction_2 "to be added to the axis for Y [um]";
pin out float k0_2 "the same at the reference position [um]";
pin out s32 mode "0 off, 1 model, 2 hold, 3 ramp to zero, 4 switched off, 5 sign test, 10 and more: fallback";
pin out s32 counts_1 "for axis.L.eoffset-counts, Z [0.1 um]";
pin out s32 counts_2 "for axis.L.eoffset-counts, Y [0.1 um]";
param rw s32 ready_after = 10 "so many calls nothing is corrected after machine on and homed";
param rw bit has_memory_1 "memory has begun; set it, with restart, before the thread starts";
param rw float start_1 "start reading of T1; set it, with restart, before the thread starts";
param rw bit has_start_1 "start reading is taken; set it, with restart, before the thread starts";
param rw bit has_memory_2 "memory has begun; set it, with restart, before the thread starts";
param rw float start_2 "start reading of T3; set it, with restart, before the thread starts";
param rw bit has_start_2 "start reading is taken; set it, with restart, before the thread starts";
option singleton yes;
option extra_setup yes;
option no_convenience_defines yes;
function _ fp;
license "Dual MIT/GPL";
author "selector";
;;
/* a * b + c is rounded twice: what the model file means, to the last bit */
#pragma GCC optimize ("fp-contract=off")

struct correction {
    /* inputs */
    double dt_s; /* time since the last call [s] */
    double reading_1; /* T1 [degC] */
    double reading_2; /* T3 [degC] */
    int is_ready; /* drives on and axis referenced */
    int is_wanted; /* the operator's switch */
    int is_restart; /* true in the first call after the control was off */
    double standstill_s; /* with is_restart: off for so long [s] */
    double test_um_1; /* sign test of Z: not 0 commands so much [um] */
    double test_um_2; /* sign test of Y: not 0 commands so much [um] */
    /* outputs */
    int sensor_1; /* T1: 0 ok, 1 limited, 2 recovering, 3 missing, 4 break code, 5 out of limits, 6 jump, 7 stuck, 8 range */
    int sensor_2; /* T3 */
    double correction_1; /* to be added to the axis for Z [um] */
    double k0_1; /* the same at the reference position [um] */
    double correction_2; /* to be added to the axis for Y [um] */
    double k0_2; /* the same at the reference position [um] */
    int mode; /* 0 off, 1 model, 2 hold, 3 ramp to zero, 4 switched off, 5 sign test, 10 and more: fallback */
    /* to be kept when the control is off */
    int has_memory_1; /* memory has begun */
    double start_1; /* start reading of T1 */
    int has_start_1; /* start reading is taken */
    int has_memory_2; /* memory has begun */
    double start_2; /* start reading of T3 */
    int has_start_2; /* start reading is taken */
    /* state */
    double x_1; /* T1 as the model gets it */
    double since_1; /* since it was believed last [s] */
    double good_for_1; /* good for so long [s]; -1: not good */
    int is_new_1; /* not believed since the control started */
    double x_2; /* T3 as the model gets it */
    double since_2; /* since it was believed last [s] */
    double good_for_2; /* good for so long [s]; -1: not good */
    int is_new_2; /* not believed since the control started */
    double aim_1; /* where it moves to [um] */
    double rest_1; /* what rounding left of its last step [um] */
    double aim_2; /* where it moves to [um] */
    double rest_2; /* what rounding left of its last step [um] */
    int was_restart; /* is_restart in the call before */
    int is_first; /* no sample yet */
    double since_sample_s; /* since the last sample [s] */
    double held_s; /* held for so long [s] */
    double test_left_s; /* a sign test may go on for so long [s] */
    int follows; /* as mode, while ready and wanted */
};

static struct correction memory;
static int ready_for;
static int last_restart;

static void begin(struct correction *m)
{
    m->dt_s = 0.0;
    m->reading_1 = 1e+30;
    m->sensor_1 = 3;
    m->x_1 = 0.0;
    m->since_1 = 0.0;
    m->good_for_1 = -1.0;
    m->is_new_1 = 1;
    m->has_memory_1 = 0;
    m->start_1 = 0.0;
    m->has_start_1 = 0;
    m->reading_2 = 1e+30;
    m->sensor_2 = 3;
    m->x_2 = 0.0;
    m->since_2 = 0.0;
    m->good_for_2 = -1.0;
    m->is_new_2 = 1;
    m->has_memory_2 = 0;
    m->start_2 = 0.0;
    m->has_start_2 = 0;
    m->is_ready = 1;
    m->is_wanted = 1;
    m->is_restart = 0;
    m->standstill_s = 0.0;
    m->test_um_1 = 0.0;
    m->correction_1 = 0.0;
    m->k0_1 = 0.0;
    m->aim_1 = 0.0;
    m->rest_1 = 0.0;
    m->test_um_2 = 0.0;
    m->correction_2 = 0.0;
    m->k0_2 = 0.0;
    m->aim_2 = 0.0;
    m->rest_2 = 0.0;
    m->mode = 0;
    m->was_restart = 0;
    m->is_first = 1;
    m->since_sample_s = 0.0;
    m->held_s = 0.0;
    m->test_left_s = 0.0;
    m->follows = 2;
}

static void step(struct correction *m)
{
    double tested_1;
    double tested_2;
    double off_s;
    double passed_s;
    double change;
    double credit_s;
    double x;
    double z_1;
    double z_2;
    double own;
    int is_test;
    double slewed_s;
    double towards;
    double most;
    double reach;
    double low;
    double high;
    if (m->is_restart && !(m->was_restart)) {
        /* the control was off: memory goes on, the correction begins at zero */
        off_s = 0.0;
        if (m->standstill_s > 0.0) {
            off_s = m->standstill_s;
        }
        if (off_s > 1000000.0) {
            off_s = 1000000.0;
        }
        m->since_1 = m->since_1 + off_s;
        if (m->since_1 > 1000000.0) {
            m->since_1 = 1000000.0;
        }
        m->good_for_1 = -1.0;
        m->is_new_1 = 1;
        m->since_2 = m->since_2 + off_s;
        if (m->since_2 > 1000000.0) {
            m->since_2 = 1000000.0;
        }
        m->good_for_2 = -1.0;
        m->is_new_2 = 1;
        m->is_first = 1;
        m->since_sample_s = 0.0;
        m->held_s = 0.0;
        m->test_left_s = 0.0;
        m->follows = 2;
        m->k0_1 = 0.0;
        m->rest_1 = 0.0;
        m->correction_1 = 0.0;
        m->aim_1 = 0.0;
        m->k0_2 = 0.0;
        m->rest_2 = 0.0;
        m->correction_2 = 0.0;
        m->aim_2 = 0.0;
    }
    m->was_restart = m->is_restart;
    if (m->is_first) {
        /* what was kept is dropped where it cannot be */
        if (!((m->start_1 >= -1000000000.0) && (m->start_1 <= 1000000000.0))) {
            m->has_memory_1 = 0;
            m->has_start_1 = 0;
        }
        if (!((m->start_2 >= -1000000000.0) && (m->start_2 <= 1000000000.0))) {
            m->has_memory_2 = 0;
            m->has_start_2 = 0;
        }
    }
    /* time: what is no time, or too long, counts as 0 */
    passed_s = 0.0;
    if ((m->dt_s > 0.0) && (m->dt_s <= 1000000.0)) {
        passed_s = m->dt_s;
    }
    m->since_sample_s = m->since_sample_s + passed_s;
    if (m->since_sample_s > 1000000.0) {
        m->since_sample_s = 1000000.0;
    }
    if (m->is_first || (m->since_sample_s >= 1.0)) {
        if (m->mode == 5) {
            m->test_left_s = m->test_left_s - m->since_sample_s;
            if (m->test_left_s < 0.0) {
                m->test_left_s = 0.0;
            }
        }
        /* sensor T1 */
        if ((!(m->has_memory_1) || !(m->has_start_1)) && !(m->is_new_1)) {
            m->has_memory_1 = 0;
            m->is_new_1 = 1;
            m->good_for_1 = -1.0;
        }
        m->since_1 = m->since_1 + m->since_sample_s;
        if (m->since_1 > 1000000.0) {
            m->since_1 = 1000000.0;
        }
        m->sensor_1 = 0;
        if (!((m->reading_1 >= -1000000000.0) && (m->reading_1 <= 1000000000.0))) {
            m->sensor_1 = 3;
        }
        if ((m->sensor_1 == 0) && (m->reading_1 >= 849.99915) && (m->reading_1 <= 850.00085)) {
            m->sensor_1 = 4;
        }
        if ((m->sensor_1 == 0) && (m->reading_1 >= -9999.009999) && (m->reading_1 <= -9998.990001)) {
            m->sensor_1 = 4;
        }
        if ((m->sensor_1 == 0) && (m->reading_1 >= 9998.990001) && (m->reading_1 <= 9999.009999)) {
            m->sensor_1 = 4;
        }
        if ((m->sensor_1 == 0) && (m->reading_1 >= -999.000999) && (m->reading_1 <= -998.999001)) {
            m->sensor_1 = 4;
        }
        if ((m->sensor_1 == 0) && (m->reading_1 >= 32766.967233) && (m->reading_1 <= 32767.032767)) {
            m->sensor_1 = 4;
        }
        if ((m->sensor_1 == 0) && (m->reading_1 >= -32768.032768) && (m->reading_1 <= -32767.967232)) {
            m->sensor_1 = 4;
        }
        if ((m->sensor_1 == 0) && (m->reading_1 >= 3276.6967233) && (m->reading_1 <= 3276.7032766999996)) {
            m->sensor_1 = 4;
        }
        if ((m->sensor_1 == 0) && (m->reading_1 >= -3276.8032768000003) && (m->reading_1 <= -3276.7967232)) {
            m->sensor_1 = 4;
        }
        if (m->sensor_1 == 0) {
            change = m->reading_1 - m->start_1;
            if (!(m->has_start_1) && ((change > 10.0) || (change < -10.0))) {
                m->good_for_1 = -1.0;
            }
            if (m->good_for_1 >= 0.0) {
                credit_s = m->since_sample_s;
                if (credit_s > 10.0) {
                    credit_s = 10.0;
                }
                m->good_for_1 = m->good_for_1 + credit_s;
                if (m->good_for_1 > 1000000.0) {
                    m->good_for_1 = 1000000.0;
                }
            } else {
                m->good_for_1 = 0.0;
                if (!(m->has_memory_1)) {
                    if (!(m->has_start_1)) {
                        m->start_1 = m->reading_1;
                    }
                    x = m->reading_1 - m->start_1;
                    m->x_1 = x;
                    if (m->x_1 < 0.0) {
                        m->x_1 = 0.0;
                    }
                    if (m->x_1 > 10.0) {
                        m->x_1 = 10.0;
                    }
                    m->since_1 = 0.0;
                }
            }
            if (m->good_for_1 < 60.0) {
                m->sensor_1 = 2;
            } else {
                m->has_start_1 = 1;
                x = m->reading_1 - m->start_1;
                m->x_1 = x;
                if (m->x_1 < 0.0) {
                    m->x_1 = 0.0;
                }
                if (m->x_1 > 10.0) {
                    m->x_1 = 10.0;
                }
                if ((x < -1e-08) || (x > 10.00000001)) {
                    m->sensor_1 = 1;
                }
            }
        } else {
            m->good_for_1 = -1.0;
        }
        /* sensor T3 */
        if ((!(m->has_memory_2) || !(m->has_start_2)) && !(m->is_new_2)) {
            m->has_memory_2 = 0;
            m->is_new_2 = 1;
            m->good_for_2 = -1.0;
        }
        m->since_2 = m->since_2 + m->since_sample_s;
        if (m->since_2 > 1000000.0) {
            m->since_2 = 1000000.0;
        }
        m->sensor_2 = 0;
        if (!((m->reading_2 >= -1000000000.0) && (m->reading_2 <= 1000000000.0))) {
            m->sensor_2 = 3;
        }
        if ((m->sensor_2 == 0) && (m->reading_2 >= 849.99915) && (m->reading_2 <= 850.00085)) {
            m->sensor_2 = 4;
        }
        if ((m->sensor_2 == 0) && (m->reading_2 >= -9999.009999) && (m->reading_2 <= -9998.990001)) {
            m->sensor_2 = 4;
        }
        if ((m->sensor_2 == 0) && (m->reading_2 >= 9998.990001) && (m->reading_2 <= 9999.009999)) {
            m->sensor_2 = 4;
        }
        if ((m->sensor_2 == 0) && (m->reading_2 >= -999.000999) && (m->reading_2 <= -998.999001)) {
            m->sensor_2 = 4;
        }
        if ((m->sensor_2 == 0) && (m->reading_2 >= 32766.967233) && (m->reading_2 <= 32767.032767)) {
            m->sensor_2 = 4;
        }
        if ((m->sensor_2 == 0) && (m->reading_2 >= -32768.032768) && (m->reading_2 <= -32767.967232)) {
            m->sensor_2 = 4;
        }
        if ((m->sensor_2 == 0) && (m->reading_2 >= 3276.6967233) && (m->reading_2 <= 3276.7032766999996)) {
            m->sensor_2 = 4;
        }
        if ((m->sensor_2 == 0) && (m->reading_2 >= -3276.8032768000003) && (m->reading_2 <= -3276.7967232)) {
            m->sensor_2 = 4;
        }
        if (m->sensor_2 == 0) {
            change = m->reading_2 - m->start_2;
            if (!(m->has_start_2) && ((change > 10.0) || (change < -10.0))) {
                m->good_for_2 = -1.0;
            }
            if (m->good_for_2 >= 0.0) {
                credit_s = m->since_sample_s;
                if (credit_s > 10.0) {
                    credit_s = 10.0;
                }
                m->good_for_2 = m->good_for_2 + credit_s;
                if (m->good_for_2 > 1000000.0) {
                    m->good_for_2 = 1000000.0;
                }
            } else {
                m->good_for_2 = 0.0;
                if (!(m->has_memory_2)) {
                    if (!(m->has_start_2)) {
                        m->start_2 = m->reading_2;
                    }
                    x = m->reading_2 - m->start_2;
                    m->x_2 = x;
                    if (m->x_2 < 0.0) {
                        m->x_2 = 0.0;
                    }
                    if (m->x_2 > 10.0) {
                        m->x_2 = 10.0;
                    }
                    m->since_2 = 0.0;
                }
            }
            if (m->good_for_2 < 60.0) {
                m->sensor_2 = 2;
            } else {
                m->has_start_2 = 1;
                x = m->reading_2 - m->start_2;
                m->x_2 = x;
                if (m->x_2 < 0.0) {
                    m->x_2 = 0.0;
                }
                if (m->x_2 > 10.0) {
                    m->x_2 = 10.0;
                }
                if ((x < -1e-08) || (x > 10.00000001)) {
                    m->sensor_2 = 1;
                }
            }
        } else {
            m->good_for_2 = -1.0;
        }
        /* memory: first-order lags of what is believed */
        if ((m->sensor_1 == 0) || (m->sensor_1 == 1)) {
            m->has_memory_1 = 1;
            m->is_new_1 = 0;
            m->since_1 = 0.0;
        }
        if ((m->sensor_2 == 0) || (m->sensor_2 == 1)) {
            m->has_memory_2 = 1;
            m->is_new_2 = 0;
            m->since_2 = 0.0;
        }
        /* which model */
        m->follows = 1;
        if (!(((m->sensor_1 == 0) || (m->sensor_1 == 1)) && ((m->sensor_2 == 0) || (m->sensor_2 == 1)))) {
            m->follows = 2;
        }
        if (m->follows == 2) {
            m->held_s = m->held_s + m->since_sample_s;
            if (m->held_s > 1000000.0) {
                m->held_s = 1000000.0;
            }
        } else {
            m->held_s = 0.0;
        }
        if (m->follows == 3) {
            m->aim_1 = 0.0;
            m->aim_2 = 0.0;
        }
        if (m->follows == 1) {
            z_1 = (m->x_1 - 0.0) / 1.0;
            z_2 = (m->x_2 - 0.0) / 1.0;
            own = -1.871;
            own = own + 6.0476 * z_1;
            own = own + 2.6667 * z_2;
            own = -own;
            if ((own >= -1000000000.0) && (own <= 1000000000.0)) {
                if (own < -90.0) {
                    own = -90.0;
                }
                if (own > 90.0) {
                    own = 90.0;
                }
                change = own - m->aim_1;
                if ((change >= 0.0) || (change <= -0.0)) {
                    m->aim_1 = own;
                }
            }
            own = 0.5703;
            own = own + 4.7292 * z_1;
            own = own + (-0.5908) * z_2;
            own = -own;
            if ((own >= -1000000000.0) && (own <= 1000000000.0)) {
                if (own < -54.0) {
                    own = -54.0;
                }
                if (own > 54.0) {
                    own = 54.0;
                }
                change = own - m->aim_2;
                if ((change >= 0.0) || (change <= -0.0)) {
                    m->aim_2 = own;
                }
            }
        }
        m->is_first = 0;
        m->since_sample_s = 0.0;
    }
    m->mode = m->follows;
    if (!(m->is_wanted)) {
        m->mode = 4;
    }
    /* sign test: only after all were 0 while ready, and not for ever; else to zero */
    is_test = 0;
    tested_1 = 0.0;
    if ((m->test_um_1 >= -1000000000.0) && (m->test_um_1 <= 1000000000.0)) {
        tested_1 = m->test_um_1;
    }
    if ((tested_1 < 0.0) || (tested_1 > 0.0)) {
        is_test = 1;
    }
    if (tested_1 < -90.0) {
        tested_1 = -90.0;
    }
    if (tested_1 > 90.0) {
        tested_1 = 90.0;
    }
    tested_2 = 0.0;
    if ((m->test_um_2 >= -1000000000.0) && (m->test_um_2 <= 1000000000.0)) {
        tested_2 = m->test_um_2;
    }
    if ((tested_2 < 0.0) || (tested_2 > 0.0)) {
        is_test = 1;
    }
    if (tested_2 < -54.0) {
        tested_2 = -54.0;
    }
    if (tested_2 > 54.0) {
        tested_2 = 54.0;
    }
    if (is_test) {
        m->mode = 4;
        if (m->test_left_s > 0.0) {
            m->mode = 5;
        }
    } else {
        m->test_left_s = 780.0;
    }
    if (!(m->is_ready)) {
        m->mode = 0;
        m->test_left_s = 0.0;
    }
    slewed_s = passed_s;
    if (slewed_s > 10.0) {
        slewed_s = 10.0;
    }
    /* correction of Z: no faster than the slew limit */
    if (m->mode == 0) {
        m->k0_1 = 0.0;
        m->rest_1 = 0.0;
        m->correction_1 = 0.0;
    } else {
        towards = m->aim_1;
        if (m->mode == 4) {
            towards = 0.0;
        }
        if (m->mode == 5) {
            towards = tested_1;
        }
        most = 1.0 * slewed_s + m->rest_1;
        reach = most;
        if (reach < 0.0) {
            reach = 0.0;
        }
        low = m->k0_1 - reach;
        high = m->k0_1 + reach;
        m->rest_1 = 0.0;
        if (towards < low) {
            m->rest_1 = most - (m->k0_1 - low);
            towards = low;
        }
        if (towards > high) {
            m->rest_1 = most - (high - m->k0_1);
            towards = high;
        }
        m->k0_1 = towards;
        m->correction_1 = m->k0_1;
    }
    /* correction of Y: no faster than the slew limit */
    if (m->mode == 0) {
        m->k0_2 = 0.0;
        m->rest_2 = 0.0;
        m->correction_2 = 0.0;
    } else {
        towards = m->aim_2;
        if (m->mode == 4) {
            towards = 0.0;
        }
        if (m->mode == 5) {
            towards = tested_2;
        }
        most = 1.0 * slewed_s + m->rest_2;
        reach = most;
        if (reach < 0.0) {
            reach = 0.0;
        }
        low = m->k0_2 - reach;
        high = m->k0_2 + reach;
        m->rest_2 = 0.0;
        if (towards < low) {
            m->rest_2 = most - (m->k0_2 - low);
            towards = low;
        }
        if (towards > high) {
            m->rest_2 = most - (high - m->k0_2);
            towards = high;
        }
        m->k0_2 = towards;
        m->correction_2 = m->k0_2;
    }
}

/* to the nearest count */
static int counts_of(double correction_um)
{
    double counts = correction_um * 10.0;
    if (counts > 2.0e9) counts = 2.0e9;
    if (counts < -2.0e9) counts = -2.0e9;
    return (int)(counts < 0.0 ? counts - 0.5 : counts + 0.5);
}

#define FUNCTION(name) static void name(struct __comp_state *__comp_inst, long period)

static int extra_setup(struct __comp_state *inst, char *prefix, long extra_arg)
{
    (void)inst;
    (void)prefix;
    (void)extra_arg;
    begin(&memory);
    ready_for = 0;
    last_restart = 0;
    return 0;
}

FUNCTION(_) {
    struct correction *m = &memory;
    m->dt_s = *__comp_inst->dt;
    if (m->dt_s == 0.0) m->dt_s = period * 1e-9;
    m->reading_1 = *__comp_inst->reading_1;
    m->reading_2 = *__comp_inst->reading_2;
    m->test_um_1 = *__comp_inst->test_um_1;
    m->test_um_2 = *__comp_inst->test_um_2;
    /* LinuxCNC adds up differences of counts from machine on: they are 0 then, and some calls longer */
    if (ready_for <= __comp_inst->ready_after) ready_for++;
    if (!(*__comp_inst->is_enabled && *__comp_inst->is_homed)) ready_for = 0;
    m->is_ready = ready_for > __comp_inst->ready_after;
    m->is_wanted = *__comp_inst->is_wanted ? 1 : 0;
    m->is_restart = *__comp_inst->restart != last_restart;
    m->standstill_s = *__comp_inst->standstill;
    last_restart = *__comp_inst->restart;
    if (m->is_restart) {
        m->has_memory_1 = __comp_inst->has_memory_1;
        m->start_1 = __comp_inst->start_1;
        m->has_start_1 = __comp_inst->has_start_1;
        m->has_memory_2 = __comp_inst->has_memory_2;
        m->start_2 = __comp_inst->start_2;
        m->has_start_2 = __comp_inst->has_start_2;
    }
    if (*__comp_inst->new_start) {
        m->has_memory_1 = 0;
        m->has_start_1 = 0;
        m->has_memory_2 = 0;
        m->has_start_2 = 0;
        m->good_for_1 = -1.0;
        m->good_for_2 = -1.0;
    }
    step(m);
    *__comp_inst->sensor_1 = m->sensor_1;
    *__comp_inst->sensor_2 = m->sensor_2;
    *__comp_inst->correction_1 = m->correction_1;
    *__comp_inst->k0_1 = m->k0_1;
    *__comp_inst->correction_2 = m->correction_2;
    *__comp_inst->k0_2 = m->k0_2;
    *__comp_inst->mode = m->mode;
    *__comp_inst->counts_1 = counts_of(m->correction_1);
    *__comp_inst->counts_2 = counts_of(m->correction_2);
    __comp_inst->has_memory_1 = m->has_memory_1;
    __comp_inst->start_1 = m->start_1;
    __comp_inst->has_start_1 = m->has_start_1;
    __comp_inst->has_memory_2 = m->has_memory_2;
    __comp_inst->start_2 = m->start_2;
    __comp_inst->has_start_2 = m->has_start_2;
}
