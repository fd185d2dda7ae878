/*
 * SIGN UNVERIFIED: do the sign test of the commissioning sheet before cutting.
 * Model: patent CN1868666, two sensors
 *   Z = -1.871 + 6.0476*dT1 + 2.6667*dT3 [um]
 *   Y = 0.5703 + 4.7292*dT1 - 0.5908*dT3 [um]
 * The correction of an axis is the negative of its displacement.
 * Equations SHA-256 a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f
 * Written by selector
 * Compile with -std=c99 -ffp-contract=off: then it computes what the model file means, to the last bit.
 */
#include "thermal_correction.h"

#ifdef __FAST_MATH__
#error "compile without -ffast-math: it takes the checks for NaN away"
#endif

void thermal_correction_init(thermal_correction *m)
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

void thermal_correction_step(thermal_correction *m)
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
