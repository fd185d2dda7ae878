/*
 * SIGN UNVERIFIED: command +10 um and read the indicator before cutting; see the commissioning sheet.
 * Model: patent CN1868666, two sensors
 *   Z = -1.871 + 6.0476*dT1 + 2.6667*dT3 [um]
 *   Y = 0.5703 + 4.7292*dT1 - 0.5908*dT3 [um]
 * The correction of an axis is the negative of its displacement.
 * Equations SHA-256 a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f
 * Written by selector
 * Whole numbers only. Times in ms (their sum has to be the true time), corrections in nm, slopes in nm/m,
 * positions in um.
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
    int32_t dt_ms; /* time since the last call [ms] */
    int32_t reading_1; /* T1: 1 degC = 1000 counts; smallest, largest number = missing */
    int32_t reading_2; /* T3: 1 degC = 1000 counts; smallest, largest number = missing */
    int32_t is_ready; /* drives on and axis referenced */
    int32_t is_wanted; /* the operator's switch */
    int32_t is_restart; /* true in the first call after the control was off */
    int32_t standstill_ms; /* with is_restart: off for so long [ms] */
    int32_t test_nm_1; /* sign test of Z: not 0 commands so much [nm] */
    int32_t test_nm_2; /* sign test of Y: not 0 commands so much [nm] */
    /* outputs */
    int32_t sensor_1; /* T1: 0 ok, 1 limited, 2 recovering, 3 missing, 4 break code, 5 out of limits, 6 jump, 7 stuck, 8 range */
    int32_t sensor_2; /* T3 */
    int32_t correction_1; /* to be added to the axis for Z [nm] */
    int32_t k0_1; /* the same at the reference position [nm] */
    int32_t correction_2; /* to be added to the axis for Y [nm] */
    int32_t k0_2; /* the same at the reference position [nm] */
    int32_t mode; /* 0 off, 1 model, 2 hold, 3 ramp to zero, 4 switched off, 5 sign test, 10 and more: fallback */
    /* to be kept when the control is off */
    int32_t has_memory_1; /* memory has begun */
    int64_t start_1; /* start reading of T1 */
    int32_t has_start_1; /* start reading is taken */
    int32_t has_memory_2; /* memory has begun */
    int64_t start_2; /* start reading of T3 */
    int32_t has_start_2; /* start reading is taken */
    /* state */
    int64_t x_1; /* T1 as the model gets it */
    int64_t since_1; /* since it was believed last [ms] */
    int64_t good_for_1; /* good for so long [ms]; -1: not good */
    int32_t is_new_1; /* not believed since the control started */
    int64_t x_2; /* T3 as the model gets it */
    int64_t since_2; /* since it was believed last [ms] */
    int64_t good_for_2; /* good for so long [ms]; -1: not good */
    int32_t is_new_2; /* not believed since the control started */
    int64_t aim_1; /* where it moves to [nm] */
    int64_t rest_1; /* what rounding left of its last step [nm] */
    int64_t aim_2; /* where it moves to [nm] */
    int64_t rest_2; /* what rounding left of its last step [nm] */
    int32_t was_restart; /* is_restart in the call before */
    int32_t is_first; /* no sample yet */
    int64_t since_sample_ms; /* since the last sample [ms] */
    int64_t held_ms; /* held for so long [ms] */
    int64_t test_left_ms; /* a sign test may go on for so long [ms] */
    int32_t follows; /* as mode, while ready and wanted */
} thermal_correction_i;

/* Once, before the first call. */
void thermal_correction_i_init(thermal_correction_i *m);
/* Every cycle, after the inputs are set; the outputs are in the struct. */
void thermal_correction_i_step(thermal_correction_i *m);

#endif
