/*
 * SIGN UNVERIFIED: command +10 um and read the indicator before cutting; see the commissioning sheet.
 * Model: patent CN1868666, two sensors
 *   Z = -1.871 + 6.0476*dT1 + 2.6667*dT3 [um]
 *   Y = 0.5703 + 4.7292*dT1 - 0.5908*dT3 [um]
 * The correction of an axis is the negative of its displacement.
 * Equations SHA-256 a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f
 * Written by selector
 * Whole numbers only. Times in ms, corrections in nm, slopes in nm/m, positions in um.
 * T1: 1 degC = 1000 counts, valid 0 ... 10000 counts
 * T3: 1 degC = 1000 counts, valid 0 ... 10000 counts
 * Largest difference to the float64 model inside the valid ranges: Z 0.00922 um,
 *   0.00051 um of it for readings that are whole counts.
 * Largest difference to the float64 model inside the valid ranges: Y 0.00583 um,
 *   0.00051 um of it for readings that are whole counts.
 * No intermediate value passes 63 bits; proven for all readings when this file was written.
 */
#ifndef THERMAL_CORRECTION_I_H
#define THERMAL_CORRECTION_I_H

#include <stdint.h>

typedef struct thermal_correction_i {
    /* inputs */
    int32_t dt_ms; /* time since the last call [ms]; the sum must be the true time */
    int32_t reading_1; /* T1: 1 degC = 1000 counts; smallest, largest number = missing */
    int32_t reading_2; /* T3: 1 degC = 1000 counts; smallest, largest number = missing */
    int32_t is_ready; /* drives on, axis referenced */
    int32_t is_wanted; /* the operator's switch */
    int32_t is_restart; /* not 0 in the first call after the control was off */
    int32_t standstill_ms; /* with is_restart: off for so long [ms] */
    int32_t test_nm_1; /* sign test of Z: not 0 commands so much [nm] */
    int32_t test_nm_2; /* sign test of Y: not 0 commands so much [nm] */
    /* outputs */
    int32_t correction_1; /* to be added to the axis for Z [nm] */
    int32_t k0_1; /* the same at the reference position [nm] */
    int32_t correction_2; /* to be added to the axis for Y [nm] */
    int32_t k0_2; /* the same at the reference position [nm] */
    int32_t mode; /* 0 off, 1 model, 2 hold, 3 ramp to zero, 4 switched off, 5 sign test */
    int32_t sensor_1; /* T1: 0 ok, 1 limited, 2 recovering, 3 missing, 4 break code, 5 out of limits, 6 jump, 8 range */
    int32_t sensor_2; /* T3 */
    /* to be kept when the control is off */
    int32_t has_memory_1;
    int32_t start_1; /* start reading of T1 [counts] */
    int32_t has_start_1;
    int32_t has_memory_2;
    int32_t start_2; /* start reading of T3 [counts] */
    int32_t has_start_2;
    /* state */
    int32_t x_1;
    int32_t since_ms_1;
    int32_t good_ms_1;
    int32_t is_new_1;
    int32_t x_2;
    int32_t since_ms_2;
    int32_t good_ms_2;
    int32_t is_new_2;
    int32_t aim_1;
    int32_t rest_1;
    int32_t aim_2;
    int32_t rest_2;
    int32_t is_first;
    int32_t was_restart;
    int32_t since_ms;
    int32_t held_ms;
    int32_t test_left_ms;
    int32_t follows;
} thermal_correction_i;

/* Once, before the first call. */
void thermal_correction_i_init(thermal_correction_i *m);
/* Every cycle, after the inputs are set. */
void thermal_correction_i_step(thermal_correction_i *m);

#endif
